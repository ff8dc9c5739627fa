"""The verdict on an event that the innovations form has found in a record with a reference.

The innovations form says what and when. Errors come from free runs, on stretches that did not fit the size of the
event, like those of any other hypothesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from adaptive_flot.discovery.hypotheses.comparison import blocks_of, rms, worse_outputs
from adaptive_flot.discovery.hypotheses.cross_validation import (
    fit_all_rows,
    fitted_and_tested,
    model_with,
    test_on_stretches,
)
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.judgement import Judged, WithoutSite
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, verdict_of
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.reach import outputs_in_reach
from adaptive_flot.discovery.innovations.verdicts.rivals import hardly_explained
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.greybox.model import Model


def with_event(compared: Comparison, search: Search, told: Told) -> Comparison:
    """The comparison with the event told; unchanged where free runs do not get better by it, or need not.

    Of the outputs that the event can change: where no error without it is above what is usual on the reference, there
    is nothing to explain. Where one keeps more than half of what its squared error is above that, there is more than
    the event explains, and its name would be a guess. So it is where the error of any output
    grows to more than what is usual.

    Parameters
    ----------
    compared
        The comparison of the whole record.
    search, told
        The search in innovations form, and what was judged: events, and nothing else.
    """
    events = [(told.best, h) for h in told.certain] or list(told.open)
    word: Literal["named", "class"] = "class" if told.word == "class" else "named"
    hypotheses = tuple(search.started(e, h) for e, h in events)
    constants = search.known or compared.calibration.constants
    return with_hypotheses(compared, search.model, constants, hypotheses, word, told.beside)


def with_hypotheses(
    compared: Comparison,
    model: Model,
    constants: Constants,
    hypotheses: Sequence[Hypothesis],
    word: Literal["named", "class"],
    beside: WithoutSite | None,
) -> Comparison:
    """The comparison with events told, the best first; unchanged as `with_event` says.

    Parameters
    ----------
    compared
        The comparison of the whole record.
    model, constants
        The model beside them, and what is known of its constants.
    hypotheses, word, beside
        The events, and what they are told as.
    """
    rows = compared.rows
    first = fit_all_rows(model, rows, None, constants, None)
    assert first is not None  # the model as it is can be simulated
    null = test_on_stretches(model, rows, first, hold_constants=True)
    tested = (fitted_and_tested(model, rows, h, constants, first.fit) for h in hypotheses)
    found = [t for t in tested if t is not None]
    if not found or not np.nanmean(rms(rows, found[0].fresh) / rms(rows, null.fresh)) < 1:
        return compared
    word = "class" if word == "class" and len(found) > 1 else "named"
    judged = Judged(word, found[0], tuple(found[1:]), "", float("nan"), beside)
    calibration, blocks = replace(compared.calibration, model=model), blocks_of(rows, null.fresh)
    verdict = verdict_of(calibration, rows, blocks, null, judged, True, compared.verdict.seconds)
    reached = set(outputs_in_reach(model, model_with(model, found[0].hypothesis)))
    shown = tuple(c for c in verdict.error if c.output in reached)
    if all(c.before <= ABOVE_USUAL * c.noise for c in shown) or hardly_explained(shown, ABOVE_USUAL):
        return compared
    usual, left = compared.calibration.usual.rms, rms(rows, found[0].fresh)
    if any(left[j] > ABOVE_USUAL * usual[j] for j in worse_outputs(rows, blocks, null, found[0], usual)):
        return compared
    said = compared.verdict.word in WITH_A_NAME  # what is not told over the whole record says nothing beside it
    over_all = (f"One change over the whole record would be told so: {compared.verdict.reason}",) if said else ()
    return replace(
        compared,
        verdict=replace(verdict, notes=(*verdict.notes, *over_all)),
        model=model_with(model, found[0].hypothesis).with_parameters(found[0].fit.values),
        calibration=calibration,
        blocks=blocks,
        null=null,
        tested=(*found, *compared.tested),
        judged=judged,
    )
