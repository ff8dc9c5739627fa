"""The test that is proposed: it stays in its limits, its separation is the formula's, and done, it decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.console.lines import print_verdict
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.discovery.test_design.experiment import plan_experiment
from adaptive_flot.discovery.test_design.separation import Prediction, hold_time, separation
from adaptive_flot.discovery.test_design.signals import candidate_tests, input_range
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.report.discovery.page import discovery_report
from tests.discovery.conftest import POWER
from tests.discovery.heated import DT, heated_tank, tank_record


def _prediction(white: np.ndarray, uncertain: np.ndarray) -> Prediction:
    return Prediction(white[:, None], white, uncertain)


@given(st.integers(0, 10_000))
def test_separation_is_the_formula_written_out(seed: int) -> None:
    """d' (I + X X')^-1 d with the N x N matrix inverted; without uncertainty the squared distance; symmetric."""
    rng = np.random.default_rng(seed)
    y, other = rng.standard_normal((2, 12))
    X, Z = rng.standard_normal((12, 2)), 10 * rng.standard_normal((12, 3))
    a, b = _prediction(y, X), _prediction(other, Z)
    d = y - other
    expected = d @ np.linalg.solve(np.eye(12) + X @ X.T + Z @ Z.T, d)
    assert separation(a, b) == pytest.approx(expected, rel=1e-8) == separation(b, a)
    nothing = np.zeros((12, 0))
    assert separation(_prediction(y, nothing), _prediction(other, nothing)) == pytest.approx(d @ d)
    assert separation(a, replace(b, white=y)) == 0.0


def test_what_an_uncertain_parameter_can_do_is_no_separation() -> None:
    slope = np.linspace(1.0, 2.0, 50)
    a = _prediction(np.zeros(50), 1e6 * slope[:, None])
    assert separation(a, _prediction(30 * slope, np.zeros((50, 0)))) < 1e-6
    assert np.isnan(separation(a, _prediction(np.full(50, np.nan), np.zeros((50, 0)))))


@pytest.mark.parametrize("size", [1e3, 1e8, 1e80, np.inf])
def test_a_prediction_that_runs_away_is_no_test(size: float) -> None:
    """Never negative, however uncertain a prediction is, and none where a run left the range of its model."""
    rng = np.random.default_rng(0)
    a, b = (Prediction(np.zeros((5, 1)), w, size * rng.standard_normal((5, 2))) for w in (np.ones(5), np.zeros(5)))
    found = separation(a, b)
    assert 0 <= found <= 5 if size <= 1e8 else np.isnan(found)


def test_signals_stay_in_their_limits_and_move_only_what_may_move(even: Dataset) -> None:
    inputs = heated_tank().inputs
    where = input_range(even.inputs, inputs)
    alone = list(candidate_tests([q.name for q in inputs], where, 300))
    assert alone and all(np.ptp(t.inputs[:, 0]) == 0 for t in alone)  # the power never moved, and nobody said it may
    where = input_range(even.inputs, inputs, {"power": POWER})
    tests = list(candidate_tests([q.name for q in inputs], where, 300))
    for t in tests:
        assert t.inputs.shape == (300, 2)
        assert np.all(t.inputs >= [POWER[0], even.inputs[:, 1].min()])
        assert np.all(t.inputs <= [POWER[1], even.inputs[:, 1].max()])
    assert len({t.name for t in tests}) == len(tests) > len(alone)
    assert any(np.ptp(t.inputs, axis=0).all() for t in tests)


@pytest.mark.parametrize(
    ("limits", "says"),
    [({"powr": POWER}, "power"), ({"power": (3000.0, 500.0)}, "in order"), ({"power": (500.0, 1e5)}, "10000")],
)
def test_a_limit_that_does_not_fit_is_told_before_the_search(
    even: Dataset, limits: dict[str, tuple[float, float]], says: str
) -> None:
    with pytest.raises(ModelError, match=says):
        discover(heated_tank(), even, limits=limits)


def test_it_moves_what_tells_the_two_apart(open_question: Discovery) -> None:
    """A draught takes heat in proportion to the temperature, a failing heater in proportion to the power."""
    planned = open_question.verdict.experiment
    assert planned is not None and planned.tells
    assert {p.one for p in planned.pairs} | {p.other for p in planned.pairs} >= {
        (("heat_loss", "fan_speed"),),
        (("heating", "fan_speed"),),
    }
    power, fan = planned.inputs.T
    assert np.ptp(power) > 0 and np.ptp(fan) > 0
    assert planned.tried == tuple(sorted(planned.tried, key=lambda t: -t.separation))
    assert planned.tried[0].separation == planned.pairs[0].separation > 3 * planned.watching
    entry = open_question.verdict.as_dict()["experiment"]
    assert entry["tells_apart"] and entry["moves"][0]["time_s"] == 0.0
    assert {"power [W]", "fan_speed [1/s]"} < set(entry["moves"][0])


def test_done_it_decides(even: Dataset, open_question: Discovery) -> None:
    """The tank carries out the test. Refitted on both, the wrong one is worse by about what was expected."""
    planned = open_question.verdict.experiment
    assert planned is not None
    inputs = np.vstack([even.inputs, planned.inputs])
    both = tank_record(rows=len(inputs), seed=1, inputs=inputs)
    after = discover(heated_tank(), both)
    assert after.verdict.word == "named"
    assert [(e.effect.site, e.effect.driver) for e in after.verdict.effects] == [("heat_loss", "fan_speed")]
    assert after.search is not None and open_question.search is not None

    def gap(found: Discovery) -> float:
        assert found.search is not None
        by_name = {a.names: a.fit.bic for a in found.search.alternatives}
        return by_name[(("heating", "fan_speed"),)] - by_name[(("heat_loss", "fan_speed"),)]

    grown = gap(after) - gap(open_question)
    assert grown > planned.needed
    assert 0.2 < grown / planned.pairs[0].separation < 5


def test_one_alternative_needs_no_test(draught: Discovery) -> None:
    assert draught.problem is not None and draught.search is not None
    alone = draught.search.alternatives[:1]
    assert plan_experiment(draught.problem, alone, 10.0) is None
    assert draught.verdict.experiment is None and draught.verdict.as_dict()["experiment"] is None


def test_an_effect_of_time_is_held_as_it_ended(draught: Discovery) -> None:
    """A curve in time would go on along a straight line for ever; in a test the site keeps its last value."""
    curve = Effect("heat_loss", "time", "curve", {"value_1": 0.0, "value_2": 0.1, "value_3": 0.4},
                   {"knots": (0.0, 5000.0, 10_000.0)})  # fmt: skip
    model = heated_tank().with_effects([curve])
    held = hold_time(model, 10_000.0)
    x, u = np.array([310.0]), np.tile([1500.0, 10.0], (20, 1))
    shifted = heated_tank().with_effects([Effect("heat_loss", "constant", "shift", {"amplitude": 0.4})])
    runs = [Stepper(m, DT).simulate(x, u, m.parameter_values, t) for m, t in ((held, 10_000.0), (shifted, 0.0))]
    np.testing.assert_allclose(runs[0].outputs, runs[1].outputs, rtol=1e-12)


def test_page_and_command_line_tell_the_test(open_question: Discovery, capsys: pytest.CaptureFixture[str]) -> None:
    planned = open_question.verdict.experiment
    assert planned is not None
    page = discovery_report(open_question, "tank")
    assert "Which input moves would tell" in page and planned.name in page
    assert all(f'<th scope="row" class="words">{t:g}</th>' in page for t, _ in planned.moves())
    print_verdict(open_question.verdict)
    said = " ".join(capsys.readouterr().out.split())
    assert planned.name in said and "heating by fan_speed" in said
