"""Bumpless transfer of a running loop to an extended model.

The estimator for the extended model starts where the one before stood at the start of the record, with the parameters
that were fitted. Its state there is the one fitted with them: the states of a model that lacked an effect are off by
what it lacked. Where none was fitted, states are carried over and those of the effects are at rest. It then takes the
samples since again, so that whatever it remembers is what it would remember had it known the effect since then. An
effect of size zero, with parameters and states kept, so changes nothing, to the bit. The controller goes on with its
previous inputs and its plan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import root

from adaptive_flot.contracts import AnyController, AnyEstimator, Estimate, Prior, Setup, TakesOver, full_parameters
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.adaptation.extension import Extension
from adaptive_flot.runner.loop.loop import Running, Step

Rebuild = Callable[[Model], tuple[AnyEstimator, AnyController]]


@dataclass(frozen=True)
class BumplessTransfer:
    """A loop on the extended model, and the estimates of the samples that were taken again, before and after."""

    running: Running
    before: tuple[Estimate, ...]
    after: tuple[Estimate, ...]


def transfer(
    running: Running, steps: Sequence[Step], extension: Extension, rebuild: Rebuild, since: float
) -> BumplessTransfer:
    """Extend the model of the estimator and the controller of a running loop.

    Parameters
    ----------
    running
        The loop after its last step.
    steps
        Its steps.
    extension
        What changes.
    rebuild
        Makes estimator and controller for a model.
    since
        Start of the record [s]. The samples from then on are taken again, but none from before the estimator started.

    Raises
    ------
    AdaptiveFlotError
        The plug-ins do not take the extended model.
    """
    assert running.prior is not None  # an estimator runs: there is something to extend
    old = running.estimator.setup
    model = extension.model(old.model)
    estimator, controller = rebuild(model)
    first, prior = _where(running.prior, steps, since)
    start = extended_prior(prior, old.model, model, old.parameters, extension.parameters, steps[first - 1])
    if extension.initial_state is not None:
        start = replace(start, state=_fitted_state(extension, estimator.setup, start, steps[:first], since))
    if extension.effects:  # what they explain, the errors do not show any more
        start = replace(start, colour=None)
    further = np.concatenate([running.further, model.parameter_values[len(old.model.parameters) :]])
    now = replace(running, estimator=estimator, controller=controller, further=further)
    now = replace(now, estimator_state=estimator.init(start))
    again = []
    for step in steps[first:]:
        state, estimate = estimator.update(now.estimator_state, now.with_all_parameters(step.plant.sample))
        now = replace(now, estimator_state=state, estimate=estimate)
        again.append(estimate)
    now = replace(now, prior=start.at(again[-1]))
    known = tuple(s.estimate for s in steps[first:] if s.estimate is not None)
    if isinstance(controller, TakesOver):
        taken = controller.take_over(running.controller, running.controller_state, known, tuple(again))
        now = replace(now, controller_state=taken)
    return BumplessTransfer(now, known, tuple(again))


def _where(started: Prior, steps: Sequence[Step], since: float) -> tuple[int, Prior]:
    """First step to take again, one at least, and where the estimator stood before it.

    Not before it started with its present model: older estimates are of another one.
    """
    times = [s.plant.sample.time for s in steps]
    first = min(int(np.searchsorted(times, max(since, started.time) + 1e-9, side="right")), len(steps) - 1)
    estimate = steps[first - 1].estimate
    if estimate is None or estimate.time <= started.time + 1e-9:
        return first, started
    return first, started.at(estimate)


def _fitted_state(extension: Extension, setup: Setup, start: Prior, steps: Sequence[Step], since: float) -> FloatArray:
    """State at the start, of the free run from the fitted one through the steps of the record before it."""
    assert extension.initial_state is not None
    inputs = [s.plant.sample.inputs for s in steps if s.plant.sample.time > since + 1e-9]
    if not inputs:
        return extension.initial_state
    p = full_parameters(setup.model, setup.parameters, start.parameters)
    run = Stepper(setup.model, setup.dt).simulate(extension.initial_state, np.vstack(inputs), p, since)
    return np.asarray(run.states[-1])


def extended_prior(
    prior: Prior,
    before: Model,
    after: Model,
    names: Sequence[str],
    values: Mapping[str, float],
    at: Step,
) -> Prior:
    """The same start for an extended model: the states of its effects at rest, parameters replaced by name.

    `names` are the adapted parameters, in the order of the prior; `at` is the step that ends at its time.
    """
    theta = prior.parameters.copy()
    for name, value in values.items():
        theta[list(names).index(name)] = value
    new, state, joint = len(after.states) - len(before.states), prior.state, prior.joint_covariance
    if new:
        p = full_parameters(after, names, theta)
        state = np.concatenate([state, states_at_rest(after, state, at.plant.sample.inputs, p, prior.time)])
        if joint is not None:
            nx = len(before.states)
            joint = np.insert(np.insert(joint, [nx] * new, 0.0, axis=0), [nx] * new, 0.0, axis=1)
    return replace(prior, state=state, parameters=theta, joint_covariance=joint)


def states_at_rest(model: Model, known: FloatArray, inputs: FloatArray, p: FloatArray, time: float) -> FloatArray:
    """States that follow those known (nx - k,) so that they do not move: (k,); 1, their scale, where none is found.

    Inputs (nu,) and parameters (np,) are held; the known states need not be steady.
    """
    rates = FastCall(model.ode)
    k = len(model.states) - len(known)

    def own(s: FloatArray) -> FloatArray:
        return rates(time, np.concatenate([known, s]), inputs, p)[0][-k:]

    solution = root(own, np.ones(k), tol=1e-12)
    return np.asarray(solution.x, dtype=float) if np.isfinite(solution.x).all() else np.ones(k)
