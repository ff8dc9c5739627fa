"""How far apart two fitted models are in a test.

For two models a and b with predictions y_a, y_b, noise covariance W and uncertain parameters (covariances P_a, P_b,
sensitivities X_a, X_b), the separation is d' (W + X_a P_a X_a' + X_b P_b X_b')^-1 d with d = y_a - y_b: Box & Hill
(1967), *Technometrics* 9:57, extended by the variance of the predictions as in Buzzi-Ferraris & Forzatti (1983), *Chem.
Eng. Sci.* 38:225. It is about how much worse the criterion (minus two log-likelihood) of the wrong one would be after
the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper

DRIFT = 0.3
"""Standard deviation of an adapted parameter, and of what changes with time, in a test: as a share of its value."""
RUN_AWAY = 1e9
"""Standard deviations beyond which a simulated test says nothing: the model has left its range."""
LONG_AGO = 1e6
"""Time [s] before a test of the step that stands for a held effect."""
SEEN, BEYOND = (0.005, 0.995), 1.0
"""Quantiles between which a record has been, and how far beyond a test may bring an output, as a share of that."""


@dataclass(frozen=True)
class Prediction:
    """Predicted outputs (N, m) of a test, the same whitened, and what its uncertain parameters add to that, per std."""

    outputs: FloatArray
    white: FloatArray
    uncertain: FloatArray


def predictions(problem: Problem, fit: Fit, noise: Noise, tests: Sequence[FloatArray]) -> list[Prediction]:
    """Predictions of one fit for each test (inputs (N, nu)), from the state in which it ends.

    `noise` is that of every model compared; outputs are measured as often as at the end of the record.
    """
    record, columns = problem.record, list(problem.columns)
    p = parameters_of(fit)
    run = Stepper(fit.model, record.dt).simulate(fit.initial_state, record.inputs[1:], p, float(record.time[0]))
    start, end = run.states[-1], float(record.time[-1])
    held = hold_time(fit.model, end)
    names, root = _uncertain(fit, held, problem)
    stepper = Stepper(held, record.dt)
    weight = np.median(problem.weights, axis=0)
    measured = np.isfinite(problem.measured)[-len(tests[0]) :]
    predicted = []
    for test in tests:
        zero = np.zeros((len(start), len(names)))
        s = stepper.simulate_sensitivities(start, test, held.parameter_values, names, zero, end)
        y = s.outputs[:, columns]
        white = noise.whiten(y / weight)[measured]
        slopes = noise.whiten(s.gradient[:, columns] / weight[:, None])[measured]
        predicted.append(Prediction(y, white, slopes @ root))
    return predicted


def stays_near(problem: Problem, model: Model, outputs: FloatArray) -> bool:
    """Whether outputs (N, m) stay in their physical range, and within the width of the record about it.

    A force held at its high end drives an axis out of its rail, though no input leaves its range.
    """
    quantities = [model.outputs[c] for c in problem.columns]
    physical = np.array([(q.lower, q.upper) for q in quantities]).T
    least, most = np.nanquantile(problem.measured, SEEN, axis=0)
    beyond = BEYOND * (most - least)
    low, high = np.maximum(physical[0], least - beyond), np.minimum(physical[1], most + beyond)
    return bool(np.all((outputs >= low) & (outputs <= high)))


def hold_time(model: Model, time: float) -> Model:
    """The model with every effect of time kept as it is at `time` [s]: nobody knows how it would go on."""
    effects = []
    for e in model.fitted_effects():
        if e.driver == "time" and e.family.static is not None:
            values = {k: ca.SX(v) for k, v in e.coefficients.items()}
            g = float(ca.evalf(ca.SX(e.family.static(ca.SX(time), values, e.full_settings))))
            past = {"amplitude": g, "onset": time - LONG_AGO}
            effects.append(Effect(e.site, "time", "step", past, mode=e.mode))
        else:
            effects.append(e)
    return model.without_effects().with_effects(effects)


def _uncertain(fit: Fit, held: Model, problem: Problem) -> tuple[tuple[str, ...], FloatArray]:
    """Uncertain parameters of a test, and a root of their covariance: that of the fit, and drift on top."""
    timed = [e.parameter("amplitude") for e in held.effects if e.driver == "time"]
    of_time = {e.parameter(c.name) for e in fit.model.effects if e.driver == "time" for c in e.terms}
    kept = [i for i, n in enumerate(fit.names) if n not in of_time]
    names = (*(fit.names[i] for i in kept), *timed)
    values = held.parameter_values[held.indices("parameters", names)]
    covariance = np.zeros((len(names), len(names)))
    covariance[: len(kept), : len(kept)] = fit.covariance[np.ix_(kept, kept)]
    drifting = np.array([n in problem.adapted or n in timed for n in names])
    covariance[np.diag_indices(len(names))] += np.where(drifting, (DRIFT * values) ** 2, 0.0)
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    strength, turned = np.linalg.eigh(covariance / np.outer(size, size))
    return names, size[:, None] * turned * np.sqrt(np.maximum(strength, 0.0))


def separation(a: Prediction, b: Prediction) -> float:
    """Separation of two predictions of one test: d' (I + X X')^-1 d, whitened, from the singular values of X.

    NaN where a prediction is no number or has run away: nobody would plan a test by it.
    """
    d = a.white - b.white
    X = np.hstack([a.uncertain, b.uncertain])
    if not (np.all(np.abs(d) < RUN_AWAY) and np.all(np.abs(X) < RUN_AWAY)):
        return float("nan")
    turned, size, _ = np.linalg.svd(X, full_matrices=False)
    along = turned.T @ d
    across = d - turned @ along  # what no uncertain parameter touches, and what is left along each that is uncertain
    return float(across @ across + np.sum(along**2 / (1 + size**2)))
