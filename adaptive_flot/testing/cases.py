"""What the checks run on: an estimator or a controller, and a short record of a process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import (
    AnyController,
    AnyEstimator,
    ControllerSetup,
    Decision,
    Estimate,
    Prior,
    Sample,
    Setup,
    Status,
)
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.testing.processes import ROWS, CaseProcess, flotation_process

NOISE_STD = 1e-3
"""As a share of an output."""


@dataclass(frozen=True)
class EstimatorCase:
    """An estimator, where it starts, and a short record of a process with one drifting parameter."""

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
    process: CaseProcess | None = None,
    model: Model | None = None,
    parameters: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    **options: Any,
) -> EstimatorCase:
    """Build a case for an estimator class or factory, called as `factory(setup, **options)`.

    Parameters
    ----------
    factory, options
        The estimator.
    seed
        Of the record's noise.
    process
        What the record is of; default the laboratory flotation cell.
    model, parameters, outputs
        Instead of those of the process: a model with effects, say, other parameters to adapt, other outputs that drive.
    """
    process = _with(process or flotation_process(), model, parameters, outputs)
    setup = Setup(process.model, process.dt, tuple(process.parameters), tuple(process.outputs))
    samples, _ = _record(process, seed)
    size = np.abs([sample.outputs for sample in samples]).mean(axis=0)[setup.model.indices("outputs", setup.outputs)]
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.parameters)]
    prior = Prior(
        time=0.0,
        state=steady_state(setup.model, process.inputs[0]).state,
        parameters=nominal,
        covariance=np.diag((0.02 * nominal) ** 2),
        noise_std=NOISE_STD * size,
    )
    return EstimatorCase(factory(setup, **options), prior, samples)


def controller_case(
    factory: Callable[..., AnyController],
    seed: int = 1,
    *,
    process: CaseProcess | None = None,
    model: Model | None = None,
    **options: Any,
) -> ControllerCase:
    """Build a case for a controller class or factory, called as `factory(setup, **options)`; the rest as above."""
    process = _with(process or flotation_process(), model, None, None)
    samples, states = _record(process, seed)
    nominal = process.model.parameter_values[process.model.indices("parameters", process.parameters)]
    setup = ControllerSetup(
        process.model, process.dt, process.inputs.copy(), tuple(process.parameters), process.limits, process.economics
    )
    estimates = tuple(
        Estimate(
            time=sample.time,
            prediction=sample.outputs,
            innovation=np.zeros_like(sample.outputs),
            innovation_std=np.full(len(process.outputs), NOISE_STD),
            parameters=nominal,
            covariance=np.diag((0.02 * nominal) ** 2),
            state=state,
            status=Status.OK,
        )
        for sample, state in zip(samples, states, strict=True)
    )
    return ControllerCase(factory(setup, **options), setup, samples, estimates)


def _with(
    process: CaseProcess, model: Model | None, parameters: Sequence[str] | None, outputs: Sequence[str] | None
) -> CaseProcess:
    given = {"model": model, "parameters": parameters, "outputs": outputs}
    return replace(process, **{key: value for key, value in given.items() if value is not None})  # type: ignore[arg-type]


def _record(process: CaseProcess, seed: int) -> tuple[tuple[Sample, ...], FloatArray]:
    """Samples of a record with noise, and the true state at each (ROWS, nx)."""
    generator = np.random.default_rng(seed)
    model, inputs = process.model, process.inputs.copy()
    p = np.tile(model.parameter_values, (ROWS, 1))
    p[:, model.index("parameters", process.drifting)] *= np.linspace(1.0, 1.02, ROWS)
    run = Stepper(model, process.dt).simulate(steady_state(model, inputs[0]).state, inputs, p)
    outputs = run.outputs * (1 + NOISE_STD * generator.standard_normal(run.outputs.shape))
    samples = (Sample(float(t), u, y) for t, u, y in zip(run.time, inputs, outputs, strict=True))
    return tuple(samples), run.states


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
