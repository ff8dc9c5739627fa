"""Events in time start where the curve that was fitted first draws them."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.catalogue import Candidate
from adaptive_flot.discovery.events import event_scores
from adaptive_flot.discovery.scoring import Score
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
    step, ramp, washout = event_scores(score, curve)
    assert [s.variant.effect.form for s in (step, ramp, washout)] == ["step", "ramp", "washout"]
    assert ramp.start["amplitude"] == pytest.approx(-0.2, rel=0.1)
    assert ramp.start["onset"] == pytest.approx(900.0, abs=240.0)
    assert ramp.start["duration"] == pytest.approx(750.0, rel=0.4)
    assert 900.0 < step.start["onset"] < 1650.0


def test_a_washout_is_found_in_its_curve() -> None:
    """Onset to within a knot; the time constant to within the spacing of what is tried."""
    t = np.array(KNOTS)
    score, curve = score_of(0.3 * (1 - np.exp(-np.maximum(t - 1200.0, 0) / 300.0)))
    washout = event_scores(score, curve)[2]
    assert washout.start["amplitude"] == pytest.approx(0.3, rel=0.15)
    assert washout.start["onset"] == pytest.approx(1200.0, abs=240.0)
    assert washout.start["time_constant"] == pytest.approx(300.0, rel=0.5)
