"""Protects: an event is not told to be over from the first row on that no fit has seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.unseen_times import with_unseen_changes, with_unseen_ends
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.greybox.effects import Effect
from tests.discovery.heated import DT, Truth, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")
OFF = 3.0


@pytest.mark.parametrize("rows_after", [0, 150])
def test_an_event_lasts_where_no_fitted_row_has_seen_its_end(rows_after: int) -> None:
    """The thermometer shows 3 K more; it is right again in rows that were fitted, or the record ends before."""
    record = tank_record()
    n = len(record)
    first = n // 2
    problem = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5)
    last_fitted = int(np.flatnonzero(problem.rows("estimate", "confirm"))[-1])
    end = last_fitted + 1 - rows_after
    y = record.outputs.copy()
    y[first : (n if not rows_after else end)] += OFF
    problem = make_problem(replace(record, outputs=y), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fitter = Fitter(problem, ("estimate", "confirm"))
    onset, long = float(record.time[first]), (end - first) * DT
    event = Effect("thermometer", "time", "switch", settings={"count": 1.0, "width": DT})
    names = tuple(event.parameter(c.name) for c in event.terms)
    start = dict(zip(names, (OFF, onset - DT / 2, long), strict=True))
    base = fitter.fit(heated_tank())
    assert base is not None
    near = {name: (start[name] - DT, start[name] + DT) for name in names[1:]}
    fit = fitter.fit(base.model.with_effects([event]), names, start, base, near)
    assert fit is not None
    again = with_unseen_ends(fitter, fit)
    (told,) = again.model.fitted_effects()
    over = told.coefficients["on_1"] + told.coefficients["for_1"]
    if rows_after:
        assert again is fit and over < record.time[last_fitted] - 100 * DT
    else:
        assert over > record.time[-1] and event.parameter("for_1") not in again.names
        assert told.coefficients["amplitude"] == pytest.approx(OFF, rel=0.05)
        report = problem.rows("report") & (np.arange(n) > last_fitted + 5)
        left = [np.sqrt(np.mean(f.residual(problem)[report] ** 2)) for f in (fit, again)]
        assert not report.any() or left[1] <= left[0] + 1e-9


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_a_change_within_a_held_out_stretch_is_told_where_that_has_it(share: float) -> None:
    """The thermometer shows 3 K more from the middle of a report stretch on; fitted rows say between which of them."""
    record = tank_record(Truth(exponent=0.0))
    problem = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5)
    begins, ends = problem.spans("report")[1]
    jumps = begins + share * (ends - begins)
    y = record.outputs + OFF * (record.time >= jumps)[:, None]
    problem = make_problem(replace(record, outputs=y), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fitter = Fitter(problem, ("estimate", "confirm"))
    event = Effect("thermometer", "time", "step", settings={"width": DT})
    amplitude, onset = (event.parameter(c.name) for c in event.terms)
    base = fitter.fit(heated_tank())
    assert base is not None
    start = {amplitude: OFF, onset: ends}
    fit = fitter.fit(base.model.with_effects([event]), (amplitude, onset), start, base, {onset: (begins, ends)})
    assert fit is not None
    again, times = with_unseen_changes(fitter, fit)
    assert times[0] == pytest.approx(jumps, abs=DT)
    place = fit.names.index(onset)
    assert again.values[place] == pytest.approx(times[0]) and np.sqrt(again.covariance[place, place]) < 2 * DT
    report = problem.rows("report")
    left = [np.sqrt(np.mean(f.residual(problem)[report] ** 2)) for f in (fit, again)]
    assert left[1] < 0.5 * left[0], "what the wrong time left is gone"
    assert with_unseen_changes(fitter, again)[1] == (), "it is where the stretch has it"
    np.testing.assert_allclose(again.values[: place - 1], fit.values[: place - 1])


def test_a_time_that_fitted_rows_have_seen_stays() -> None:
    record = tank_record(Truth(exponent=0.0))
    problem = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5)
    begins, ends = problem.spans("estimate")[1]
    y = record.outputs + OFF * (record.time >= (begins + ends) / 2)[:, None]
    problem = make_problem(replace(record, outputs=y), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fitter = Fitter(problem, ("estimate", "confirm"))
    event = Effect("thermometer", "time", "step", settings={"width": DT})
    names = tuple(event.parameter(c.name) for c in event.terms)
    base = fitter.fit(heated_tank())
    assert base is not None
    start = dict(zip(names, (OFF, (begins + ends) / 2), strict=True))
    fit = fitter.fit(base.model.with_effects([event]), names, start, base)
    assert fit is not None
    assert with_unseen_changes(fitter, fit) == (fit, ())


def test_both_ends_of_a_spell_within_one_stretch_keep_their_order() -> None:
    """A spell of ten rows, told as two rows at another time of the same report stretch."""
    record = tank_record(Truth(exponent=0.0))
    begins, ends = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5).spans("report")[1]
    first = begins + 0.5 * (ends - begins)
    y = record.outputs + OFF * ((record.time >= first) & (record.time < first + 10 * DT))[:, None]
    problem = make_problem(replace(record, outputs=y), heated_tank(), ADAPTED, burn_in=30, guard=5)
    fitter = Fitter(problem, ("estimate", "confirm"))
    event = Effect("thermometer", "time", "switch", settings={"count": 1.0, "width": DT})
    amplitude, onset, long = (event.parameter(c.name) for c in event.terms)
    base = fitter.fit(heated_tank())
    assert base is not None
    start = {amplitude: OFF, onset: first - 3 * DT, long: 2 * DT}
    fit = fitter.fit(base.model.with_effects([event]), (amplitude, onset, long), start, base, rounds=0)
    assert fit is not None
    again, times = with_unseen_changes(fitter, fit)
    assert len(times) == 2 and times[1] - times[0] >= DT
    left = [np.sum(f.residual(problem)[problem.rows("report")] ** 2) for f in (fit, again)]
    assert left[1] < left[0]
