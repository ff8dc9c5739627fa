"""Events in time start where the curve that was fitted first draws them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.catalogue import Candidate
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.shapes.step_events import (
    event_scores,
    freer,
    other_shape,
    slow,
    slower_scores,
    step_score,
)
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.processes import flotation

KNOTS = tuple(float(k) for k in np.linspace(0.0, 3000.0, 14))


def score_of(values: np.ndarray) -> tuple[Score, Effect]:
    site = next(s for s in flotation.make_model().sites if s.name == "froth_recovery")
    coefficients = {f"value_{k + 1}": float(v) for k, v in enumerate(values)}
    curve = Effect("froth_recovery", "time", "curve", coefficients, settings={"knots": KNOTS})
    return Score(Candidate(site, "time", True, ()), None, 1.0, 1.0, {}), curve  # type: ignore[arg-type]


@pytest.mark.parametrize("constant", [0.0, 0.3])
def test_a_ramp_is_found_in_its_curve(constant: float) -> None:
    """Onset and duration to within a knot, whatever constant the curve carries (the adapted parameters take it)."""
    t = np.array(KNOTS)
    score, curve = score_of(constant - 0.2 * np.clip((t - 900.0) / 750.0, 0, 1))
    ramp, washout = event_scores(score, curve)
    assert [s.variant.effect.form for s in (ramp, washout)] == ["ramp", "washout"]
    assert ramp.start["amplitude"] == pytest.approx(-0.2, rel=0.1)
    assert ramp.start["onset"] == pytest.approx(900.0, abs=240.0)
    assert ramp.start["duration"] == pytest.approx(750.0, rel=0.4)
    assert step_score(score, _fitted(ramp), 3000.0) is None


def _fitted(score: Score) -> Effect:
    return replace(score.variant.effect, coefficients=score.start)


@pytest.mark.parametrize("form", ["ramp", "washout"])
def test_what_is_over_at_once_is_tried_as_a_step(form: str) -> None:
    score, _ = score_of(np.zeros(14))
    length = "duration" if form == "ramp" else "time_constant"
    event = Effect("froth_recovery", "time", form, {"amplitude": 0.4, "onset": 1000.0, length: 20.0})
    step = step_score(score, event, 3000.0)
    assert step is not None
    assert step.variant.effect.form == "step"
    assert step.start == {"amplitude": 0.4, "onset": 1010.0}


@pytest.mark.parametrize("form", ["ramp", "washout"])
def test_a_freer_profile_starts_as_the_profile_it_frees(form: str) -> None:
    """At its knots, which stand around the event."""
    length = "duration" if form == "ramp" else "time_constant"
    event = Effect("froth_recovery", "time", form, {"amplitude": 0.4, "onset": 1000.0, length: 100.0})
    found = freer(event, 0.0, 3000.0)
    assert found is not None
    variant, start = found
    knots = np.array(variant.effect.settings["knots"])
    values = np.array([start[f"value_{k + 1}"] for k in range(len(knots))])
    since = np.maximum(knots - 1000.0, 0) / 100.0
    np.testing.assert_allclose(values, 0.4 * (np.minimum(since, 1) if form == "ramp" else 1 - np.exp(-since)))
    assert knots[0] == 0.0 and knots[-1] == 3000.0 and np.sum((knots > 1000) & (knots < 1300)) >= 3
    assert not slow(variant.effect)


def test_a_drift_is_freed_to_a_curve_with_even_knots() -> None:
    values = np.sin(np.arange(14.0))
    _, curve = score_of(values)
    found = freer(curve, 0.0, 3000.0)
    assert found is not None and slow(found[0].effect) and len(found[1]) == 28
    assert freer(found[0].effect, 0.0, 3000.0) is None
    long = {"amplitude": 0.4, "onset": 1000.0, "duration": 500.0}
    assert freer(Effect("froth_recovery", "time", "ramp", long), 0.0, 3000.0) is None
    assert slow(Effect("froth_recovery", "time", "ramp", long))


def test_a_washout_is_found_in_its_curve() -> None:
    """Onset to within a knot; the time constant to within the spacing of what is tried."""
    t = np.array(KNOTS)
    score, curve = score_of(0.3 * (1 - np.exp(-np.maximum(t - 1200.0, 0) / 300.0)))
    washout = event_scores(score, curve)[1]
    assert washout.start["amplitude"] == pytest.approx(0.3, rel=0.15)
    assert washout.start["onset"] == pytest.approx(1200.0, abs=240.0)
    assert washout.start["time_constant"] == pytest.approx(300.0, rel=0.5)


def test_a_large_change_at_once_is_an_event_though_its_knots_are_even() -> None:
    """A plateau by a factor of two, and the same profile a tenth as large or spread over the record."""
    knots = np.linspace(0.0, 3000.0, 28)

    def curve(values: np.ndarray) -> Effect:
        coefficients = {f"value_{k + 1}": float(v) for k, v in enumerate(values)}
        return Effect("coalescence", "time", "curve", coefficients, {"knots": tuple(map(float, knots))})

    plateau = 0.7 * ((knots > 1000) & (knots < 2000))
    assert not slow(curve(plateau))
    assert slow(curve(0.1 * plateau))
    assert slow(curve(0.7 * knots / 3000.0))


def test_around_a_step_slower_events_are_tried() -> None:
    """Both have its size, and are half way there when it jumps; what is no step has its own."""
    score, curve = score_of(np.zeros(14))
    step = Effect("froth_recovery", "time", "step", {"amplitude": 0.4, "onset": 1000.0}, {"width": 3.0})
    ramp, washout = slower_scores(score, step, 3000.0)
    assert ramp.start["onset"] + ramp.start["duration"] / 2 == pytest.approx(1000.0)
    assert washout.start["onset"] < 1000.0 < washout.start["onset"] + 3 * washout.start["time_constant"]
    assert ramp.start["amplitude"] == washout.start["amplitude"] == 0.4
    assert slower_scores(score, curve, 3000.0) == slower_scores(score, _fitted(ramp), 3000.0) == []


@pytest.mark.parametrize(("form", "length", "other", "expected"), [
    ("ramp", {"duration": 300.0}, "washout", {"time_constant": 100.0}),
    ("washout", {"time_constant": 100.0}, "ramp", {"duration": 300.0}),
])  # fmt: skip
def test_a_ramp_and_a_washout_are_tried_as_each_other(
    form: str, length: dict[str, float], other: str, expected: dict[str, float]
) -> None:
    """From one onset, and over at one time."""
    score, curve = score_of(np.zeros(14))
    begun = {"amplitude": 0.4, "onset": 1000.0}
    tried = other_shape(score, Effect("froth_recovery", "time", form, {**begun, **length}))
    assert tried is not None and tried.variant.effect.form == other
    assert tried.start == pytest.approx({**begun, **expected})
    assert other_shape(score, curve) is None
