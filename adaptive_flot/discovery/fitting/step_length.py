"""Steps of the integration that are short enough for a record, for the model as it came and for what a fit found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import noise_by_differences
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.step_size import with_short_steps


def steps_for(problem: Problem, model: Model, fit: Fit | None = None, *, longer: bool = False) -> Model:
    """The model, its `max_step_s` as the record asks for; made `longer` where that is said. See `with_short_steps`.

    The error of the integration is looked at along the run from the model's own values, or along that of a fit of the
    model with or without effects. A discrepancy that the integration makes is else taken for one of the plant.
    """
    if fit is None:
        unknowns = Unknowns(problem, model, (), {}, None, {})
        run, state, parameters = model, unknowns.x0, unknowns.base
    else:
        run, state, parameters = fit.model, fit.initial_state, parameters_of(fit)
    noise = np.maximum(noise_by_differences(problem.measured), problem.floor)
    short = with_short_steps(run, problem.record, state, parameters, problem.columns, noise, longer=longer)
    return model if short is run else replace(model, max_step_s=short.max_step_s)


def steps_words(given: Model, used: Model) -> tuple[str, ...]:
    """A word on steps that were made shorter; none where they were not."""
    if used.max_step_s >= given.max_step_s:
        return ()
    return (
        f"max_step_s={given.max_step_s:g} of model '{given.name}' is too long for this record: the integration errs by "
        f"more than a fifth of the noise; {used.max_step_s:.3g} s was used",
    )
