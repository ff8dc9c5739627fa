"""What runs in shadow sees the same samples, writes nothing, and does not touch the acting cycle whatever it does."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import select

from adaptive_flot.contracts import Prior, Sample
from adaptive_flot.errors import LinkError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.shadow.process import MOST_BEHIND
from adaptive_flot.live.shadow.worker import ShadowPlan, ShadowStepper, Task, make_stepper
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.beside import ShadowResult
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.live.store.numbers import as_array, as_text
from adaptive_flot.live.store.shadows import compare
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.desk_bench import DeskBench

ROWS = 25


class Hanging(ShadowStepper):
    """Does not come to an end."""

    def __init__(self) -> None:
        pass

    def step(self, task: Task) -> ShadowResult:
        time.sleep(3600)
        raise AssertionError


class Dying(Hanging):
    """Takes its process with it."""

    def step(self, task: Task) -> ShadowResult:
        os._exit(17)


class Raising(Hanging):
    """Fails."""

    def step(self, task: Task) -> ShadowResult:
        raise ValueError("it failed")


def failing(link_file: Path, plan: ShadowPlan) -> ShadowStepper:
    """One way to fail for each role."""
    if plan.role == "unbuilt":
        raise LinkError("no such thing")
    return {"hanging": Hanging, "dying": Dying, "raising": Raising}[plan.role]()


def bits(outcomes: list[Outcome]) -> list[str]:
    """What cycles came to, to the bit."""
    return [
        f"{o.mode} {o.faults} {dict(o.writes)} {o.acting}"
        f" {None if o.estimate is None else as_text(o.estimate.state)}"
        f" {None if o.decision is None else as_text(o.decision.inputs)}"
        for o in outcomes
    ]


@pytest.fixture(scope="module")
def shadowed(write_link: Callable[..., Link], scenario: Scenario) -> Link:
    """A link whose own estimator and controller run in shadow too."""
    return write_link(scenario, {"controller": "pi", "shadows": {"twin": {"estimator": "rpem", "controller": "pi"}}})


@pytest.fixture(scope="module")
def alone(link: Link) -> list[str]:
    """The acting link without a shadow."""
    bench = DeskBench(link)
    bench.to_closed()
    return bits(bench.run(ROWS))


def test_shadows_that_fail_are_a_status_and_an_alarm_and_nothing_else(
    write_link: Callable[..., Link], scenario: Scenario, alone: list[str]
) -> None:
    roles = {"dying": "ended with 17", "raising": "ValueError: it failed", "unbuilt": "LinkError: no such thing"}
    parts = {role: {"estimator": "rpem"} for role in (*roles, "hanging")}
    bench = DeskBench(write_link(scenario, {"controller": "pi", "shadows": parts}), failing)

    def done() -> bool:
        shadows = bench.desk.shadows()
        return shadows["hanging"].left_out > 0 and all(f"shadow {role}" in bench.desk.alarms for role in roles)

    try:
        bench.to_closed()
        assert bits(bench.run(ROWS)) == alone
        limit = time.monotonic() + 120
        while not done():
            bench.run(1)
            time.sleep(0.1)  # four processes start, from which intervals would only take the processor
            assert time.monotonic() < limit, bench.desk.shadows()
        shadows = bench.desk.shadows()
    finally:
        bench.desk.close()
    assert bench.state.modes.mode is Mode.CLOSED
    for role, words in roles.items():
        assert words in shadows[role].status and not shadows[role].runs
    hanging = shadows["hanging"]
    assert hanging.runs and f"slow: {MOST_BEHIND} samples behind" in hanging.status and hanging.compared.rows == 0


def test_a_twin_in_shadow_makes_the_same_errors_and_is_stored_under_its_role(
    shadowed: Link, alone: list[str], tmp_path: Path
) -> None:
    engine = open_database("sqlite:///shadow.sqlite", tmp_path)
    bench = DeskBench(shadowed, make_stepper, Memory(engine, shadowed))
    try:
        bench.to_closed()
        assert bits(bench.run(ROWS)) == alone
        limit = time.monotonic() + 120
        while (twin := bench.desk.shadows()["twin"]).compared.rows < ROWS:
            bench.run(1)
            time.sleep(0.2 if twin.newest is None else 0.01)  # intervals would only take its processor while it starts
            assert time.monotonic() < limit
    finally:
        bench.desk.close()
    compared = bench.desk.shadows()["twin"].compared
    assert [name for name, _, _ in compared.errors] == ["concentrate_grade", "level"]
    for _, acting, shadow in compared.errors:
        assert shadow == pytest.approx(acting, rel=0.1), "the same estimator, started later"
    s, e = schema.shadows.c, schema.estimates.c
    with engine.connect() as connection:
        joined = schema.shadows.join(schema.estimates, (s.session == e.session) & (s.cycle == e.cycle))
        query = select(s.cycle, s.role, s.innovation, e.innovation.label("own")).select_from(joined).order_by(s.cycle)
        rows = connection.execute(query).mappings().all()
    assert {row["role"] for row in rows} == {"twin"} and len({row["cycle"] for row in rows}) == len(rows)
    seen = [(as_array(r["innovation"]), as_array(r["own"])) for r in rows if r["innovation"] is not None]
    mine, own = (np.vstack(both) for both in zip(*seen, strict=True))
    assert np.corrcoef(mine[:, 0], own[:, 0])[0, 1] > 0.9, "each beside the acting one of its own cycle"
    table = {row.quantity: row for row in compare(engine, shadowed)}
    for j, name in enumerate(shadowed.scenario.model.names("outputs")):
        unit = shadowed.scenario.model.outputs[j].unit
        if np.isfinite(own[:, j]).any():
            row = table.pop(f"one-step error of {name} [{unit}]")
            assert (row.role, row.rows) == ("twin", len(own))
            assert row.acting == pytest.approx(np.sqrt(np.mean(own[:, j] ** 2)))
            assert row.shadow == pytest.approx(np.sqrt(np.mean(mine[:, j] ** 2)))
    assert set(table) == {"mean air_flow decided [m3/s]", "mean level_setpoint decided [m]"}
    assert all(row.shadow == pytest.approx(row.acting, rel=0.05) for row in table.values())
    engine.dispose()


def test_an_extended_model_starts_at_the_state_that_was_fitted_with_it(link: Link) -> None:
    """The acting estimator's state is off by what its model lacks; the fitted one, run on, is not."""
    scenario = link.scenario
    effect = Effect("bubble_size", "air_flow", "linear", {"slope": 0.4}, {"reference": 1.5e-3})
    model = scenario.model.with_effects((effect,))
    realisation = Realisation(scenario, 1)
    inputs = realisation.schedule[:40]
    fitted = steady_state(model, inputs[0], model.parameter_values).state
    truth = Stepper(model, scenario.dt).simulate(fitted, inputs, model.parameter_values, 5.0)
    q, known = len(scenario.setup.parameters), model.parameter_values
    values = known[model.indices("parameters", scenario.setup.parameters)]
    off = Prior(43.0, 0.5 * truth.states[37, : len(scenario.model.states)], values, 1e-9 * np.eye(q), np.array([1e-3]))
    plan = ShadowPlan("extended", "rpem", None, (effect,), (), (fitted, 5.0, inputs[:30]))
    stepper = ShadowStepper(link, plan)
    unseen = np.full(len(model.outputs), np.nan)
    for k in (38, 39, 40):  # the last eight inputs before the start are taken to be those of row 30
        sample = Sample(5.0 + k, inputs[min(k - 1, 29)], unseen)
        result = stepper.step(Task(k, sample, sample.inputs, off))
    assert result.estimate is not None
    played = np.vstack([inputs[:30], np.repeat(inputs[29:30], 10, axis=0)])
    expected = Stepper(model, scenario.dt).simulate(fitted, played, known, 5.0)
    np.testing.assert_allclose(result.estimate.state, expected.states[-1], rtol=1e-9)


def test_nothing_in_the_process_of_a_shadow_knows_how_to_write() -> None:
    """It imports no OPC UA client; what it is given are samples, what it gives back are results."""
    code = "import sys, adaptive_flot.live.shadow.worker; print([m for m in sys.modules if 'asyncua' in m])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
