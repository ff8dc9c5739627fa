"""Where a fit starts: a late sensor hides in a store, where it stays too fast; a guess may be far too large."""

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.filter.refit import Refit, Refitter
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN
from adaptive_flot.discovery.innovations.search.search import STARTS, Search
from adaptive_flot.greybox.effects import Effect
from benchmarks.other_processes.plants.heat_exchanger import make_model as model
from tests.discovery.innovations.exchanger import HOLDUP, LATE, UA, record

NAMES = ("ua", "holdup")


@pytest.mark.parametrize("seed", [0])
def test_a_late_thermometer_is_found_from_the_constants_as_the_model_came(seed: int) -> None:
    data, plain = record("late", seed=seed), model()

    def best(given: tuple[float, ...]) -> tuple[float, np.ndarray]:
        floor = noise_floor([data], (0,))
        search = Search(plain, data, (0,), floor, NAMES, as_given=given, kinds=("lag",))
        with np.errstate(all="ignore"):
            found = best_explanations(search, search.base(np.array([UA, 2.5 * HOLDUP])))[0]
        assert "thermometer lag" in [h.label for h in found.hypotheses]
        return found.criterion, found.fit.p

    stuck, _ = best(())  # a second late part may help there
    gain, fitted = best(tuple(plain.parameter_values))
    found = fitted[[0, 1, -1]]
    assert len(fitted) == 4, "two constants and one lag: its share and its time"
    assert gain > stuck + LEAST_GAIN, "explained better, and by one effect"
    assert found == pytest.approx([UA, HOLDUP, LATE], rel=0.12)


BY_FLOW = Hypothesis(
    "transfer",
    "flow",
    "depends",
    Effect("transfer", "flow", "curve", settings={"knots": (0.8, 2.2)}, mode="factor"),
    ("value_1", "value_2"),
    ({},),
)


LAG = Hypothesis(
    "thermometer", "lag", "lag", Effect("thermometer", "lag", "lag", {"amplitude": 1.0}, {"scale": 1.0}),
    ("time_constant",), ({},),
)  # fmt: skip


def started_from(monkeypatch: pytest.MonkeyPatch, h: Hypothesis, guess: list[float]) -> list[float]:
    """Coefficients from which a fit of an effect begins, for a guess of them."""
    data, plain = record("nothing"), model()
    search = Search(plain, data, (0,), noise_floor([data], (0,)), ("ua", "holdup"))
    fit, seen = Refitter.fit, list[np.ndarray]()

    def begins(self: Refitter, p: np.ndarray, *given: object, **more: object) -> Refit:
        seen.append(p)
        return fit(self, p, *given, **more)  # type: ignore[arg-type]

    with np.errstate(all="ignore"):
        base = search.base(np.array([UA, HOLDUP]))
        extended = model_with(search.model, h)
        p = extended.parameter_values
        p[: len(base.fit.p)] = base.fit.p
        own = list(extended.indices("parameters", h.parameters))
        p[own] = guess
        monkeypatch.setattr(Refitter, "fit", begins)
        search.added(base, h, p)
    return list(seen[-1][own])


@pytest.mark.parametrize("guess", [[np.log(4.0), -np.log(4.0)], [-np.log(4.0), np.log(4.0)]])
def test_a_guess_that_is_far_too_large_is_made_smaller(monkeypatch: pytest.MonkeyPatch, guess: list[float]) -> None:
    """Measured: a pair of dependences began 9,000 behind the model as it is, and ended 4,700 behind its best fit."""
    begun = started_from(monkeypatch, BY_FLOW, guess)
    assert begun == pytest.approx([STARTS[-1] * g for g in guess])


def test_a_time_constant_starts_as_it_was_guessed(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that starts short stays short."""
    assert started_from(monkeypatch, LAG, [200.0]) == [200.0]
