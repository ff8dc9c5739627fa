"""Start-up from a cell without mineral: everything stays finite, the start is known, and the loop takes over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.errors import ScenarioError
from adaptive_flot.greybox import Model, Stepper
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.runner.conftest import WriteScenario

INPUTS = np.array([1.5e-3, 1.67e-4, 0.38])


def test_without_mineral_every_output_and_signal_is_finite(model: Model) -> None:
    """The grade is that of the first mineral to arrive: with masses in the ratio of the feed, however small."""
    stepper, p = Stepper(model, 1.0), model.parameter_values
    masses = model.indices("states", ["m_valuable", "m_gangue"])
    feed = np.array([q.value for q in model.parameters if q.name.startswith("feed_concentration")])
    x = steady_state(model, INPUTS).state
    found = {}
    for amount in (0.0, 1e-9):
        x[masses] = amount * feed
        found[amount] = stepper.outputs_at(x, 0.0, INPUTS, p)
        assert np.isfinite(found[amount]).all()
    grade = model.index("outputs", "concentrate_grade")
    assert found[0.0][grade] == pytest.approx(found[1e-9][grade], rel=1e-3)
    run = stepper.simulate(np.where(np.isin(np.arange(x.size), masses), 0.0, x), np.tile(INPUTS, (5, 1)), p)
    assert np.isfinite(run.outputs).all() and np.isfinite(run.states).all()
    assert run.outputs[0, grade] == pytest.approx(found[0.0][grade], rel=2e-2)


def test_the_start_is_known_and_the_controller_takes_over() -> None:
    """Two minutes of closed loop: valid solutions only, above the limit; with the true parameters no error is left."""
    scenario = load_scenario("start_up")
    file = scenario.file.model_copy(update={"duration_s": 420.0, "cases": scenario.file.cases[:1]})
    (run,) = run_scenario(replace(scenario, file=file), seeds=[1])
    late = run.table[run.table["time_s"] > 301]
    assert set(late["control_status"]) == {"ok"} and set(late["decided_by"]) == {"economic_mpc"}
    assert np.isfinite(run.table["concentrate_grade_true"]).all() and run.account["below_limit"] == 0
    assert run.table["concentrate_grade_true"].iloc[0] > 0.45  # the pulp is as rich as the feed, the froth richer
    error = late["concentrate_grade_predicted"] - late["concentrate_grade_true"]
    assert np.sqrt((error**2).mean()) < 1e-3  # C is 10 % off its nominal value: the initial estimate found it


def test_nominal_parameters_start_from_the_known_state(write_scenario: WriteScenario) -> None:
    empty = {"m_valuable_kg": 0.0, "m_gangue_kg": 0.0}
    changes = {"initial_state": empty, "parameters": {}, "initial_estimate.options": {"initial_state": "given"}}
    run = run_scenario(load_scenario(write_scenario(changes)), ["fixed"], [1])[0]
    late = run.table[run.table["time_s"] > 60]
    np.testing.assert_allclose(late["concentrate_grade_predicted"], late["concentrate_grade_true"], rtol=1e-12)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"m_valuable": 0.0}, "did you mean 'm_valuable_kg'"),
        ({"level_m": 0.9}, r"level_m = 0.9 lies outside \[0, 0.48\]"),
    ],
)
def test_a_wrong_initial_state_is_one_clear_line(
    write_scenario: WriteScenario, entry: dict[str, float], message: str
) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario(write_scenario({"initial_state": entry}))
