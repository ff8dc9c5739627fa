"""Protects: an event is told when it began, and not where a search of its time came to rest."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.onsets import with_onset_sought
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import DT, Truth, heated_tank, tank_record


@pytest.mark.parametrize("rows_off", [-30, -15, 15, 30])
def test_an_onset_that_rests_beside_the_true_one_is_found(rows_off: int) -> None:
    """A loss that rises by half in the middle of the record; a fit of its other numbers alone, from another onset."""
    record = tank_record(Truth(exponent=0.0, loss_step=0.5))
    problem = make_problem(record, heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5)
    fitter = Fitter(problem, ("estimate", "confirm"))
    event = Effect("heat_loss", "time", "step", settings={"width": 0.1})
    names = tuple(event.parameter(c.name) for c in event.terms)
    base = fitter.fit(heated_tank())
    assert base is not None
    true = float(record.time[len(record) // 2])
    start = {names[0]: 0.4, event.parameter("onset"): true + rows_off * DT}
    held = {event.parameter("onset"): (start[event.parameter("onset")] - 1, start[event.parameter("onset")] + 1)}
    rests = fitter.fit(base.model.with_effects([event]), names, start, base, held)
    assert rests is not None
    found = with_onset_sought(fitter, rests)
    (told,) = found.model.fitted_effects()
    assert told.coefficients["onset"] == pytest.approx(true, abs=2 * DT)
    assert found.loss < rests.loss
    again = with_onset_sought(fitter, found)
    assert again.loss <= found.loss and np.isfinite(again.loss)
