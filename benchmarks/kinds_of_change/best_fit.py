"""The best-fitting parameters of a model that is wrong, for the region of an estimator to hold.

Where the model is right they are the true ones. Where not, they are the true ones times a constant factor each, the
factors for which the free run of the model comes nearest to the plant's grade without noise, over the time of the
fits: the pseudo-true parameters (White, *Econometrica* 50 (1982) 1; Ljung, *System Identification* (1999), 8.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.runner.plants.scenario_plant import initial_state, simulate_plant
from adaptive_flot.runner.scenario.realisation import Realisation

WIDEST = 1.5
"""Factors are sought within exp(+- this)."""


@dataclass(frozen=True)
class BestFit:
    """Best-fitting adapted parameters (N, q), and the root mean square error of the output that they leave."""

    parameters: FloatArray
    left: float


def best_fit(realisation: Realisation) -> BestFit:
    """Best fit of the model to what the plant of a run does without noise, in open loop.

    Only the rows at which fits are taken count.
    """
    s = realisation.scenario
    names, plant = s.setup.parameters, s.plant_model
    true = realisation.parameters[:, plant.indices("parameters", names)]
    output = s.model.index("outputs", s.setup.outputs[0])
    wanted = np.array([r.outputs[output] for r in simulate_plant(realisation)])
    rows = s.starts + s.dt > s.fits_after + 1e-9
    stepper, inputs = Stepper(s.model, s.dt), realisation.plan
    columns = s.model.indices("parameters", names)
    low, high = np.array([(q.lower, q.upper) for q in (s.model.parameters[j] for j in columns)]).T

    def moved(log_factors: FloatArray) -> FloatArray:
        values: FloatArray = np.clip(true * np.exp(log_factors), low, high)
        return values

    def errors(log_factors: FloatArray) -> FloatArray:
        p = np.tile(s.model.parameter_values, (len(inputs), 1))
        p[:, columns] = moved(log_factors)
        start = initial_state(s, s.model, inputs[0], p[0])
        found: FloatArray = (stepper.simulate(start, inputs, p).outputs[:, output] - wanted)[rows]
        return found

    fit = least_squares(
        errors, np.zeros(len(names)), bounds=(-WIDEST, WIDEST), x_scale=0.1, diff_step=np.full(len(names), 1e-3)
    )
    return BestFit(moved(fit.x), float(np.sqrt(2 * fit.cost / rows.sum())))
