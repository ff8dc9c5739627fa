"""What the checks run on: an estimator or a controller, and a short record of the laboratory cell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from adaptive_flot.contracts import (
    AnyController,
    AnyEstimator,
    ControllerSetup,
    Decision,
    Estimate,
    Limits,
    Prior,
    Sample,
    Setup,
    Status,
)
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation
from adaptive_flot.processes.flotation.economics import Prices

ADAPTED = ("growth_exponent", "coalescence_rate")
ROWS = 40
NOISE_STD = 1e-3
"""As a share of an output."""


@dataclass(frozen=True)
class EstimatorCase:
    """An estimator, where it starts, and a short record of the laboratory cell with drifting n."""

    estimator: AnyEstimator
    prior: Prior
    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class ControllerCase:
    """A controller, and samples with the estimates to decide on (true state, nominal parameters)."""

    controller: AnyController
    setup: ControllerSetup
    samples: tuple[Sample, ...]
    estimates: tuple[Estimate, ...]


def estimator_case(
    factory: Callable[..., AnyEstimator],
    seed: int = 1,
    *,
    model: Model | None = None,
    parameters: Sequence[str] = ADAPTED,
    outputs: Sequence[str] = ("concentrate_grade",),
    **options: Any,
) -> EstimatorCase:
    """Build a case for an estimator class or factory, called as `factory(setup, **options)`.

    `model` is the laboratory cell unless given: a cell with effects, say; `parameters` are those to adapt, `outputs`
    those that drive the adaptation.
    """
    setup = Setup(model or _cell(), 1.0, tuple(parameters), tuple(outputs))
    inputs, samples, _ = _record(setup, seed)
    size = np.abs([sample.outputs for sample in samples]).mean(axis=0)[setup.model.indices("outputs", setup.outputs)]
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    prior = Prior(
        time=0.0,
        state=steady_state(setup.model, inputs[0]).state,
        parameters=nominal,
        covariance=np.diag((0.02 * nominal) ** 2),
        noise_std=NOISE_STD * size,
    )
    return EstimatorCase(factory(setup, **options), prior, samples)


def controller_case(
    factory: Callable[..., AnyController], seed: int = 1, *, model: Model | None = None, **options: Any
) -> ControllerCase:
    """Build a case for a controller class or factory, called as `factory(setup, **options)`; `model` as above."""
    setup = Setup(model or _cell(), 1.0, ADAPTED, ("concentrate_grade",))
    inputs, samples, states = _record(setup, seed)
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    limits = Limits(
        outputs={"concentrate_grade": (0.20, np.inf)},
        states={"level": (0.33, 0.42)},
        inputs={"air_flow": (9.05e-4, 2.17e-3), "level_setpoint": (0.33, 0.42)},
        moves={"air_flow": 2e-4, "level_setpoint": 0.01},
    )
    controller_setup = ControllerSetup(setup.model, setup.dt, inputs, setup.parameters, limits, Prices())
    estimates = tuple(
        Estimate(
            time=sample.time,
            prediction=sample.outputs,
            innovation=np.zeros_like(sample.outputs),
            innovation_std=np.full(len(setup.outputs), NOISE_STD),
            parameters=nominal,
            covariance=np.diag((0.02 * nominal) ** 2),
            state=state,
            status=Status.OK,
        )
        for sample, state in zip(samples, states, strict=True)
    )
    return ControllerCase(factory(controller_setup, **options), controller_setup, samples, estimates)


@cache
def _cell() -> Model:
    # one model for all checks: what is compiled for it is compiled once
    return flotation.make_model()


def _record(setup: Setup, seed: int) -> tuple[FloatArray, tuple[Sample, ...], FloatArray]:
    generator = np.random.default_rng(seed)
    model = setup.model
    inputs = np.tile([1.5e-3, 1.67e-4, 0.38], (ROWS, 1))
    inputs[ROWS // 2 :, 0], inputs[ROWS // 4 :, 2] = 1.7e-3, 0.36
    p = np.tile(model.parameter_values, (ROWS, 1))
    p[:, model.index("parameters", "n")] *= np.linspace(1.0, 1.02, ROWS)
    run = Stepper(model, setup.dt).simulate(steady_state(model, inputs[0]).state, inputs, p)
    outputs = run.outputs * (1 + NOISE_STD * generator.standard_normal(run.outputs.shape))
    samples = (Sample(float(t), u, y) for t, u, y in zip(run.time, inputs, outputs, strict=True))
    return inputs, tuple(samples), run.states


def run_estimator(estimator: AnyEstimator, state: Any, samples: Sequence[Sample]) -> tuple[Any, list[Estimate]]:
    """Replay samples; the last state and every estimate."""
    estimates = []
    for sample in samples:
        state, estimate = estimator.update(state, sample)
        estimates.append(estimate)
    return state, estimates


def run_controller(
    case: ControllerCase, state: Any, samples: Sequence[Sample | None], estimates: Sequence[Estimate | None]
) -> tuple[Any, list[Decision]]:
    """Ask for a decision on each sample with its estimate; the last state and every decision."""
    decisions = []
    for sample, estimate in zip(samples, estimates, strict=True):
        state, decision = case.controller.decide(state, sample, estimate)
        decisions.append(decision)
    return state, decisions
