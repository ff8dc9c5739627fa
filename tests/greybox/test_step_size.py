"""Protects the length of integration steps: a lag, whose solution is known, needs them as short as its time constant.

A run in steps that are too long leaves a discrepancy, which a search would take for one of the plant.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.fitting.step_length import steps_words
from adaptive_flot.greybox import Dataset, Effect, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.step_size import TOLERATED, with_short_steps
from adaptive_flot.greybox.stepping.record import RecordSimulator

ROWS, NOISE = 60, 1e-3


def lag(tau: float, step: float) -> Model:
    """A first-order lag with a time constant [s], and its longest step [s]."""

    def equations(m: Scope) -> None:
        x = m.state("x")
        m.derivative("x", m.site("rate", (m.input("u") - x) / m.parameter("tau"), "process", "offset"))
        m.output("y", x)

    return Model(
        name="lag",
        states=(Quantity("x", "-", "", -10.0, 10.0, 1.0),),
        inputs=(Quantity("u", "-", "", -10.0, 10.0, 1.0),),
        parameters=(Parameter("tau", tau, "s", "given", "tau", 1e-6, 1e6, 1.0),),
        outputs=(Quantity("y", "-", "", -10.0, 10.0, 1.0),),
        equations=equations,
        max_step_s=step,
    )


def record() -> Dataset:
    """An input of steps, one row a second; what was measured does not matter."""
    u = np.random.default_rng(3).choice([-1.0, 1.0], (ROWS, 1))
    return Dataset("steps", np.arange(ROWS, dtype=float), 1.0, u, np.zeros((ROWS, 1)))


def checked(model: Model) -> Model:
    """The model with steps for the record."""
    return with_short_steps(model, record(), np.zeros(1), model.parameter_values, [0], np.array([NOISE]))


def exact(tau: float) -> np.ndarray:
    """The solution for inputs that are held, (N,)."""
    x, run, a = 0.0, [0.0], float(np.exp(-1.0 / tau))
    for u in record().inputs[1:, 0]:
        x = a * x + (1 - a) * u
        run.append(x)
    return np.array(run)


@given(st.floats(0.1, 50.0))
def test_the_run_agrees_with_the_solution_within_a_share_of_the_noise(tau: float) -> None:
    """Also where the model's own steps are so long that it runs off (a step of more than 2.8 time constants)."""
    model = checked(lag(tau, 100.0))
    run = RecordSimulator(model, 1.0).outputs(record(), np.zeros(1), model.parameter_values)[:, 0]
    assert np.sqrt(np.mean((run - exact(tau)) ** 2)) <= 1.1 * TOLERATED * NOISE


@pytest.mark.parametrize("tau", [20.0, 200.0])
def test_a_model_that_is_accurate_stays_the_same(tau: float) -> None:
    """The very object, so that no function is made anew."""
    model = lag(tau, 100.0)
    assert checked(model) is model


def test_a_model_that_no_step_helps_stays_the_same() -> None:
    """A run that is not finite in any steps: its state is not a number."""
    model = lag(20.0, 1.0)
    nan = np.array([np.nan])
    assert with_short_steps(model, record(), nan, model.parameter_values, [0], np.array([NOISE])) is model


def test_steps_are_shorter_beside_an_effect_that_turns_with_a_sign() -> None:
    """Its right-hand side has nearly a jump; shortened steps count from there."""
    turn = Effect("rate", "x", "direction", {"amplitude": 0.0, "turn": 0.5, "width": 1e-3}, {"scale": 1e-3})
    model = lag(20.0, 1.0).with_effects([turn])
    assert model.steps_in(1.0) == 4 * lag(20.0, 1.0).steps_in(1.0)
    short = checked(model)
    assert short.steps_in(1.0) > model.steps_in(1.0)
    assert short.steps_in(1.0) == round(4 * 1.0 / short.max_step_s)


def test_a_signal_that_oscillates_within_a_few_rows_is_not_taken_for_its_noise() -> None:
    """Its differences from row to row are as large as itself, and so is the noise that they seem to show."""
    model, wave = lag(0.6, 1.0), np.where(np.arange(ROWS) % 2, 1.0, -1.0)[:, None]
    there = replace(record(), inputs=wave, outputs=wave)
    short = with_short_steps(model, there, np.zeros(1), model.parameter_values, [0], np.array([2.0]))
    assert short.steps_in(1.0) > model.steps_in(1.0)


def test_steps_that_are_far_too_short_are_made_longer_where_that_changes_next_to_nothing() -> None:
    """A longest step that nobody has set is a second: rows of a minute would take sixty steps."""
    model = lag(20.0, 1.0 / 64)
    noise, p = np.array([NOISE]), model.parameter_values
    longer = with_short_steps(model, record(), np.zeros(1), p, [0], noise, longer=True)
    assert checked(model) is model
    assert longer.steps_in(1.0) == 4
    run = RecordSimulator(longer, 1.0).outputs(record(), np.zeros(1), model.parameter_values)[:, 0]
    assert np.sqrt(np.mean((run - exact(20.0)) ** 2)) <= 0.03 * NOISE
    assert steps_words(model, longer) == ()
