"""The power of a proposed test, what it may move, and what is said where no test helps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from adaptive_flot.discovery.results import Discovery
from adaptive_flot.discovery.test_design.experiment import leading, plan_experiment
from adaptive_flot.discovery.test_design.movable import held_inputs, held_words
from adaptive_flot.discovery.test_design.power import DRAWS, power
from adaptive_flot.discovery.test_design.separation import Prediction
from adaptive_flot.discovery.verdict.judge import least_separation
from adaptive_flot.greybox.data.dataset import Dataset
from tests.discovery.heated import heated_tank


def _at(white: np.ndarray, uncertain: np.ndarray | None = None) -> Prediction:
    return Prediction(white[:, None], white, np.zeros((len(white), 0)) if uncertain is None else uncertain)


@pytest.mark.parametrize("apart", [2.0, 3.3, 5.0])
def test_power_is_that_of_the_likelihood_ratio_of_two_means(apart: float) -> None:
    """L_b - L_a = d'd + 2 d'e is normal with mean D^2 and standard deviation 2 D."""
    d = np.full(25, apart / 5)
    told = power([_at(np.zeros(25)), _at(d)], needed=10.0)
    expected = norm.sf((10.0 - apart**2) / (2 * apart))
    assert told == pytest.approx((expected, expected), abs=4 * np.sqrt(0.25 / DRAWS))


def test_what_an_uncertain_parameter_can_mimic_is_not_told() -> None:
    slope = np.linspace(1.0, 2.0, 50)
    told = power([_at(np.zeros(50)), _at(3 * slope, 100 * slope[:, None])], needed=10.0)
    assert told[1] > 0.9 and told[0] < 0.1  # the free one may look like the other, hardly the other way round


def test_the_printed_test_tells_the_truth_as_often_as_it_says(open_question: Discovery) -> None:
    planned = open_question.verdict.experiment
    assert planned is not None and planned.tells and min(planned.power) >= 0.8
    assert [entry["told"] for entry in planned.as_dict()["power"]] == [round(p, 3) for p in planned.power]
    assert f"in {100 * planned.power[0]:.0f} %" in str(planned) and f"{planned.needed:.0f} is needed" in str(planned)


def test_an_input_that_follows_an_output_or_is_only_measured_is_left_alone(even: Dataset) -> None:
    model, n = heated_tank(), len(even)
    assert held_inputs(model, even) == {}
    lagged = np.concatenate([[0.0], even.outputs[:-1, 0]])
    loop = replace(even, inputs=np.column_stack([3000 - 5 * lagged, even.inputs[:, 1]]))
    held = held_inputs(model, loop)
    assert set(held) == {"power"} and "follows temperature" in held["power"]
    assert held_inputs(model, loop, allowed=("power",)) == {}
    measured = replace(model, inputs=(model.inputs[0], replace(model.inputs[1], movable=False)))
    assert held_words(held_inputs(measured, even)) == "fan_speed (only measured)" and n == 600


def test_only_what_may_be_moved_is_moved(open_question: Discovery) -> None:
    judged, search, problem = open_question.judgement, open_question.search, open_question.problem
    assert judged is not None and judged.best is not None and search is not None and problem is not None
    compared = leading(judged.best, search.alternatives, judged.margin)
    limits = {"power": (500.0, 3000.0)}
    planned = plan_experiment(problem, compared, 10.0, limits, held={"fan_speed": "only measured"})
    assert planned is not None and np.ptp(planned.inputs[:, 1]) == 0 and np.ptp(planned.inputs[:, 0]) > 0
    assert "Left alone: fan_speed (only measured)" in str(planned)
    both = {"fan_speed": "only measured", "power": "only measured"}
    assert plan_experiment(problem, compared, 10.0, limits, held=both) is None


def test_what_the_best_leaves_unexplained_is_asked_of_a_test_too(open_question: Discovery) -> None:
    """One record, one margin: what is too little here is not called enough in the next section of the page."""
    search, problem = open_question.search, open_question.problem
    assert search is not None and problem is not None
    rows = int(problem.rows("estimate").sum())
    clean, lacking = (replace(search, left=left, left_threshold=10.0) for left in (0.0, 21477.0))
    assert least_separation(clean, problem, rows) == 10.0 * clean.rows_per_effective_sample
    assert least_separation(lacking, problem, rows) == pytest.approx(21467.0)
    assert least_separation(lacking, problem, rows // 2) == pytest.approx(21467.0 / 2, rel=0.01)
