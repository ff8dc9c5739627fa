"""Which errors on held-out rows let a name of the innovations form be told: those of a free run, or over stretches."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.innovations.verdicts import telling
from adaptive_flot.discovery.results import Judgement, OutputChange
from adaptive_flot.greybox.effects import Effect

CURVE = Effect("supply", "time", "curve", {"value_1": 0.0, "value_2": 1.0}, {"knots": (0.0, 1.0)})
LEAK = Effect("valve", "own_value", "leak")
NOISE = 0.01
SURELY_LESS, UNSURE, SURELY_MORE = (0.2, 0.6), (-0.7, 0.5), (-0.9, -0.1)


def change(interval: tuple[float, float], after: float) -> OutputChange:
    return OutputChange("level", "m", 0.2, after, NOISE, interval)


def verdict(
    monkeypatch: pytest.MonkeyPatch, word: str, free: OutputChange, over: OutputChange, *, both: bool = False
) -> Judgement:
    """What is told beside a free run that has a curve in time for its best, told or not, with an error of 0.02.

    Or that has `both`, the leaking valve and the curve.
    """
    fit: Any = SimpleNamespace(loss=0.0, bic=0.0, model=None)
    fit.with_sizes = lambda values, covariance: fit
    h = SimpleNamespace(site="valve", driver="own_value", label="valve leaks")
    best = SimpleNamespace(hypotheses=(h,), criterion=10.0, fit=SimpleNamespace(rows=np.zeros(50)))
    told: Any = SimpleNamespace(
        word="named", effects=(h,), certain=(), open=(), best=best, sites=frozenset(["valve"]), why="", beside=None
    )  # fmt: skip
    monkeypatch.setattr(telling, "_free_run", lambda *a: fit)
    monkeypatch.setattr(telling, "report_errors", lambda *a: (free,))
    monkeypatch.setattr(telling, "noise_from_row_to_row", lambda *a: np.array([NOISE]))
    monkeypatch.setattr(telling, "_over_stretches", lambda *a: (over,))
    monkeypatch.setattr(telling, "outputs_in_reach", lambda *a: ("level",))
    monkeypatch.setattr(telling, "in_all_that_is_near", lambda *a: False)
    monkeypatch.setattr(telling, "told_in_words", lambda *a: "Valve does not go below 0.5.")
    rival: Any = SimpleNamespace(effects=(CURVE,), names=(("supply", "time"),))
    if both:
        rival = SimpleNamespace(effects=(LEAK, CURVE), names=(("valve", "own_value"), ("supply", "time")))
    judged = Judgement(word, rival, (("supply", "time"),) if word == "class" else (), (), 0.0)  # type: ignore[arg-type]
    monkeypatch.setattr(telling, "replace", lambda given, **new: SimpleNamespace(**vars(given) | new))
    state: Any = SimpleNamespace(
        judgement=judged, judged=judged, error=(change(SURELY_LESS, 0.02),), contradiction="", report_record=None,
        known_problem=SimpleNamespace(background=None), model=None, refitted=(fit, fit),
        searched=(None, SimpleNamespace(alternatives=[])),
    )  # fmt: skip
    monkeypatch.setattr(telling, "_is_nameable", lambda model, site, driver: True)
    search: Any = SimpleNamespace(sizes=lambda explanation: ({}, np.zeros((0, 0))))
    found: Judgement = telling.tell(state, search, told.best, told).judgement  # type: ignore[assignment]
    return found


@pytest.mark.parametrize(
    ("word", "free", "over", "told"),
    [
        ("abstain", change(UNSURE, 0.199), change(SURELY_LESS, 0.05), "named"),  # what wanders hides it in a free run
        ("abstain", change(UNSURE, 0.199), change(UNSURE, 0.199), "abstain"),  # nothing shows it
        ("abstain", change(SURELY_MORE, 0.3), change(SURELY_LESS, 0.05), "abstain"),  # held-out rows contradict it
        ("class", change(SURELY_LESS, 0.1), change(SURELY_LESS, 0.05), "named"),  # the curve follows what wanders
        ("class", change(SURELY_LESS, 0.1), change(UNSURE, 0.199), "abstain"),  # the curve has less there
        ("abstain", change(UNSURE, 0.199), change(SURELY_LESS, 0.15), "abstain"),  # most of the square is left
    ],
)
def test_stretches_decide_where_a_free_run_does_not(
    monkeypatch: pytest.MonkeyPatch, word: str, free: OutputChange, over: OutputChange, told: str
) -> None:
    assert verdict(monkeypatch, word, free, over).word == told


def test_a_curve_in_time_beside_what_is_told_is_no_other_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """It leaves the smaller error, since it follows whatever is off besides; alone it would silence the name."""
    free, over = change(SURELY_LESS, 0.1), change(UNSURE, 0.199)
    assert verdict(monkeypatch, "class", free, over, both=True).word == "named"
    assert verdict(monkeypatch, "class", free, over).word == "abstain"


def test_beside_a_course_it_is_said_why_free_runs_may_be_alike() -> None:
    """A brine 18 % weaker was told beside a table in which it changed nothing: both runs had a brine that wanders."""
    wanders: Any = SimpleNamespace(background=SimpleNamespace(course=SimpleNamespace(site="brine_strength")))
    plain: Any = SimpleNamespace(background=None)
    said = telling._over_words((change(SURELY_LESS, 0.05),), wanders)
    assert said.endswith("Both free runs have a brine strength that wanders, which may take the event up.")
    assert "wanders" not in telling._over_words((change(SURELY_LESS, 0.05),), plain)


@pytest.mark.parametrize(("over", "stands"), [((0.15, 0.9), True), ((0.25, 0.99), False), ((0.21, 1.01), False)])
def test_what_stretches_show_must_be_better_than_the_model_as_it_is(over: tuple[float, float], stands: bool) -> None:
    """From the state of a filter both outputs of a healthy wall erred by more with a cause than in a free run."""
    free = tuple(OutputChange(n, "", b, b, b, UNSURE) for n, b in (("level", 0.2), ("flow", 1.0)))
    said = tuple(OutputChange(n, "", 9.0, a, 0.1, SURELY_LESS) for n, a in zip(("level", "flow"), over, strict=True))
    assert telling._better_than_as_it_is(said, free) == stands
