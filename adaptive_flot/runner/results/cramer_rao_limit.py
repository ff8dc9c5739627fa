"""The smallest error that any estimator of a scenario can have: its posterior Cramer-Rao bound, run by run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adaptive_flot.greybox.filtering.cramer_rao_bound import (
    LinearisedTrajectory,
    ParameterDrift,
    drift_of_time_profile,
    linearise_trajectory,
    model_scale,
    posterior_cramer_rao_bound,
)
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state_gradient
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.plants.scenario_plant import initial_state
from adaptive_flot.runner.scenario.measurement_noise import measured_at, noise_std
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

MORE_SENSORS = {"air_recovery": 0.01, "concentrate_flow": 0.01}
"""Outputs that a plant may measure beside the grade, with their noise as a share of their mean."""


@dataclass(frozen=True)
class TrueRun:
    """A run as it really was: what an estimator of it can know at best.

    Parameters
    ----------
    realisation
        What the seed of the run draws; the plant must have all adapted parameters (see `has_limit`).
    inputs
        Inputs that acted (N, nu); those of the schedule in open loop.
    """

    realisation: Realisation
    inputs: FloatArray

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.realisation.scenario

    @property
    def parameters(self) -> FloatArray:
        """True parameters of the plant's model (N, np)."""
        return self.realisation.parameters

    @cached_property
    def adapted(self) -> FloatArray:
        """True values of the adapted parameters (N, q)."""
        columns = self.scenario.plant_model.indices("parameters", self.scenario.setup.parameters)
        return self.parameters[:, columns]

    @cached_property
    def start(self) -> FloatArray:
        """State (nx,) at the start."""
        return initial_state(self.scenario, self.scenario.plant_model, self.inputs[0], self.parameters[0])

    @cached_property
    def outputs(self) -> FloatArray:
        """True outputs (N, ny) without what effects on sensors add."""
        return self._stepper.simulate(self.start, self.inputs, self.parameters).outputs

    @cached_property
    def linear(self) -> LinearisedTrajectory:
        """The run, linearised."""
        names = self.scenario.setup.parameters
        return linearise_trajectory(self._stepper, names, self.start, self.inputs, self.parameters)

    @property
    def _stepper(self) -> Stepper:
        return Stepper(self.scenario.plant_model, self.scenario.dt)

    def limit(self, drift: ParameterDrift | None = None, more: Mapping[str, float] | None = None) -> FloatArray:
        """Smallest error covariance of the adapted parameters at the end of each interval (N, q, q), in their units.

        The inputs are known, and so is the start: steady at unknown parameters, or the state that the scenario gives.

        Parameters
        ----------
        drift
            How the parameters may move; default `drift_of_time_profile`, for one who is told when each parameter turns,
            but not where to. Nobody who has to find that out himself can do better.
        more
            Outputs measured every interval beside those that drive the adaptation, with their noise as a share of their
            mean.
        """
        q = len(self.scenario.setup.parameters)
        known = drift or drift_of_time_profile(self.adapted)
        noise = self.noise(more or {})
        covariance = posterior_cramer_rao_bound(self.linear, known, noise, self.first_covariance)
        return covariance[:, -q:, -q:]

    def fits(self, covariance: FloatArray) -> FloatArray:
        """Fits in percent (q,), as estimators are given them, of errors with this covariance (N, q, q)."""
        accounted = self.scenario.starts + self.scenario.dt > self.scenario.fits_after + 1e-9
        variance = np.diagonal(covariance, axis1=1, axis2=2)[accounted].sum(axis=0)
        fits: FloatArray = 100.0 * (1.0 - np.sqrt(variance) / np.linalg.norm(self.adapted[accounted], axis=0))
        return fits

    def noise(self, more: Mapping[str, float]) -> FloatArray:
        """Noise of the outputs that drive the adaptation and of `more` (N, ny); NaN where none is measured."""
        s, model = self.scenario, self.scenario.plant_model
        driving = np.isin(np.arange(len(model.outputs)), model.indices("outputs", s.setup.outputs))
        noise = np.where(measured_at(s) & driving, noise_std(s), np.nan)
        for name, relative_std in more.items():
            j = model.index("outputs", name)
            noise[:, j] = relative_std * np.abs(self.outputs[:, j]).mean()
        return noise

    @cached_property
    def first_covariance(self) -> FloatArray:
        """Covariance of states and adapted parameters before the first interval (nx + q, nx + q)."""
        s, model = self.scenario, self.scenario.plant_model
        names = s.setup.parameters
        moved = np.zeros((len(model.states), len(names)))
        if not s.file.initial_state:
            moved = steady_state_gradient(model, self.start, self.inputs[0], self.parameters[0], names)
        by_parameters = np.vstack([moved, np.eye(len(names))])
        covariance: FloatArray = by_parameters @ np.diag(model_scale(model, names) ** 2) @ by_parameters.T
        return covariance


def limits(runs: Sequence[TrueRun], more: Sequence[Mapping[str, float]]) -> FloatArray:
    """`TrueRun.limit` of runs of one scenario with each set of further outputs, in one pass.

    Returns
    -------
    FloatArray
        Covariances (runs, sets, N, q, q).
    """
    linear = LinearisedTrajectory(*(np.stack([getattr(r.linear, name) for r in runs])[:, None] for name in "FH"))
    drifts = [drift_of_time_profile(r.adapted) for r in runs]
    drift = ParameterDrift(*(np.stack([getattr(d, n) for d in drifts])[:, None] for n in ("keep", "variance")))
    noise = np.stack([[r.noise(m) for m in more] for r in runs])
    start = np.stack([r.first_covariance for r in runs])[:, None]
    q = drift.keep.shape[-1]
    return posterior_cramer_rao_bound(linear, drift, noise, start)[..., -q:, -q:]


def has_limit(scenario: Scenario) -> bool:
    """Whether the plant has all adapted parameters and driving outputs, so that there is a truth to estimate."""
    plant = scenario.plant_model
    return set(scenario.setup.parameters) <= set(plant.names("parameters")) and set(scenario.setup.outputs) <= set(
        plant.names("outputs")
    )
