"""How should RPEM forget? Rules of the literature on own seeds of both scenarios.

Command: `python -m benchmarks.estimation.forgetting`.

The recursion with propagated sensitivities, written out in NumPy for any rule that turns the last covariance into the
one before the next sample; every rule has one tuning for both scenarios. The seeds are not those of published tables.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot import metrics
from adaptive_flot.contracts import Decision, PlantRecord, Prior, Sample, Setup, Status, full_parameters
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.starts import record_of
from adaptive_flot.runner.plants.scenario_plant import simulate_plant
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation

SCENARIOS = ("paper_scenario_1", "paper_scenario_2")
SEEDS = tuple(range(101, 107))


@dataclass(frozen=True)
class Seen:
    """What a rule may look at: the last sample's number k, gradient (q,) and squared error in units of the expected."""

    k: int
    gradient: FloatArray
    error: float


Rule = Callable[[FloatArray, Seen], FloatArray]
"""Covariance (q, q) after a sample to the one before the next, both relative to the parameters' size."""


def exponential(factor: float) -> Rule:
    """P / lambda: the paper."""
    return lambda P, seen: P / factor


def directional(factor: float) -> Rule:
    """Forget only along what the last sample excited (Hagglund 1983; Kulhavy, Automatica 23 (1987))."""

    def rule(P: FloatArray, seen: Seen) -> FloatArray:
        along = P @ seen.gradient
        size = float(seen.gradient @ along)
        return P + (1 / factor - 1) * np.outer(along, along) / size if size > 0 else P

    return rule


def constant_information(samples: float, lowest: float = 0.8) -> Rule:
    """Forget as much as the last error brought (Fortescue, Kershenbaum & Ydstie, Automatica 17 (1981))."""
    return lambda P, seen: P / max(lowest, 1 - seen.error / samples)


def resetting(every: int, share: float = 0.05) -> Rule:
    """Forget nothing, but all of it now and then (Goodwin & Sin 1984, section 3.4)."""
    return lambda P, seen: share**2 * np.eye(len(P)) if (seen.k + 1) % every == 0 else P


def resetting_and_forgetting(factor: float, reset: float, share: float = 0.05) -> Rule:
    """EFRA: P / lambda + beta A - delta P A^-1 P, delta such that A is its rest (Salgado, Goodwin & Middleton 1988)."""
    A = share**2
    return lambda P, seen: P / factor + reset * A * np.eye(len(P)) - (1 / factor - 1 + reset) * P @ P / A


def stabilised(factor: float, share: float) -> Rule:
    """(lambda P^-1 + (1 - lambda) A^-1)^-1 (Kulhavy & Zarrop, Int. J. Control 58 (1993)): what `rpem_full` does."""

    def rule(P: FloatArray, seen: Seen) -> FloatArray:
        information = factor * np.linalg.inv(P) + (1 - factor) * np.eye(len(P)) / share**2
        return np.linalg.inv(information).astype(np.float64)

    return rule


def rules() -> dict[str, Rule]:
    """What is compared, by name and tuning."""
    return {
        "exponential, 0.995": exponential(0.995),
        "exponential, 0.98": exponential(0.98),
        "exponential, 0.95": exponential(0.95),
        "constant information, 30 samples": constant_information(30),
        "constant information, 100 samples": constant_information(100),
        "constant information, 300 samples": constant_information(300),
        "directional, 0.95": directional(0.95),
        "directional, 0.9": directional(0.9),
        "directional, 0.8": directional(0.8),
        "resetting to 5 % every 30 s": resetting(30),
        "resetting to 5 % every 100 s": resetting(100),
        "resetting and forgetting, 0.9, 1e-4": resetting_and_forgetting(0.9, 1e-4),
        "resetting and forgetting, 0.9, 1e-3": resetting_and_forgetting(0.9, 1e-3),
        "stabilised, 0.95 to 5 %": stabilised(0.95, 0.05),
        "stabilised, 0.9 to 3 %": stabilised(0.9, 0.03),
        "stabilised, 0.9 to 5 %": stabilised(0.9, 0.05),
        "stabilised, 0.9 to 7 %": stabilised(0.9, 0.07),
        "stabilised, 0.8 to 5 %": stabilised(0.8, 0.05),
    }


class Recursion:
    """RPEM for one output, with propagated sensitivities and any rule of forgetting.

    Parameters
    ----------
    setup
        Model, sampling interval, adapted parameters (q) and one driving output.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        model = setup.model
        self._columns = model.indices("parameters", setup.parameters)
        self._output = model.index("outputs", setup.outputs[0])
        step = Stepper(model, setup.dt).sensitivity_step(setup.parameters)
        self._step = FastCall(step, matrices=("S", "S_next", "dy"))
        self._bounds = np.array([[model.parameters[i].lower, model.parameters[i].upper] for i in self._columns]).T

    def run(self, prior: Prior, samples: list[Sample], rule: Rule) -> tuple[FloatArray, FloatArray]:
        """Estimates (N, q) and predictions of the output one sample ahead (N,)."""
        size = np.abs(self.setup.model.parameter_values[self._columns])
        x, theta, P, time = prior.state, prior.parameters, prior.covariance / np.outer(size, size), prior.time
        S = np.zeros((x.size, size.size))
        if prior.joint_covariance is not None:
            S = prior.joint_covariance[: x.size, x.size :] @ np.linalg.pinv(prior.covariance, hermitian=True)
        thetas, predictions = [], []
        for k, sample in enumerate(samples):
            p = full_parameters(self.setup.model, self.setup.parameters, theta)
            x, S, y, slope = self._step(x, S, time, sample.inputs, p)
            gradient = slope[self._output] * size / prior.noise_std[0]
            error = (sample.outputs[self._output] - y[self._output]) / prior.noise_std[0]
            along = P @ gradient
            spread = 1 + gradient @ along
            new = np.clip(theta + size * along * error / spread, *self._bounds)
            P = P - np.outer(along, along) / spread
            P = rule((P + P.T) / 2, Seen(k, gradient, float(error**2 / spread)))
            x, theta, time = x + S @ (new - theta), new, sample.time
            thetas.append(theta)
            predictions.append(y[self._output])
        return np.array(thetas), np.array(predictions)


def record(name: str, seed: int) -> tuple[Prior, list[PlantRecord]]:
    """Initial estimate of a scenario and what the plant showed from then on."""
    scenario = load_scenario(name)
    shown = simulate_plant(Realisation(scenario, seed))
    first = [Step(Decision(r.inputs, Status.OK, "schedule"), r, None) for r in shown[: scenario.initial_rows]]
    fit = Prepared.of(scenario).batch.fit(record_of(scenario, scenario.setup, first))
    return fit.prior(first[-1].plant.sample.time), shown[scenario.initial_rows :]


def main() -> None:
    """Measure and print."""
    setup = load_scenario(SCENARIOS[0]).setup
    columns = setup.model.indices("parameters", setup.parameters)
    output, recursion = setup.model.index("outputs", setup.outputs[0]), Recursion(setup)
    records = {name: [record(name, seed) for seed in SEEDS] for name in SCENARIOS}
    title = f"Fit in percent, seeds {SEEDS[0]} to {SEEDS[-1]}: median n, C, grade (lowest C)"
    table = Table("forgetting", *SCENARIOS, "mean of medians", title=title)
    for label, rule in rules().items():
        cells, medians = [], []
        for name in SCENARIOS:
            fits = []
            for prior, shown in records[name]:
                thetas, predictions = recursion.run(prior, [r.sample for r in shown], rule)
                truth = np.array([r.parameters[columns] for r in shown])
                y = np.array([r.outputs[output] for r in shown])
                fits.append([*(metrics.fit(t, e) for t, e in zip(truth.T, thetas.T, strict=True))])
                fits[-1].append(metrics.fit(y, predictions))
            n, C, grade = np.median(fits, axis=0)
            medians += [n, C, grade]
            cells.append(f"{n:.2f}, {C:.2f}, {grade:.2f} ({min(f[1] for f in fits):.1f})")
        table.add_row(label, *cells, f"{np.mean(medians):.2f}")
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
