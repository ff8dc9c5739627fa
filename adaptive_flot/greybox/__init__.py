"""The grey-box engine: models, effects on them, simulation, measured tables. It knows nothing of flotation.

Map, in the order of use
------------------------
quantities.py      Named quantities, parameters and known effects.
scope.py           What equations are written into: symbols, sites, derivatives, outputs.
lookup.py          Names, places and ranges of the quantities of a model.
model.py           Model: quantities and equations, its functions, its effects.
model_checks.py    Names, roles and ranges of a model, checked when it is made.
build.py           Equations to CasADi functions.
function_cache.py  Functions derived from a model, each made once.
forms/             Forms of an effect, their coefficients and what each coefficient does (its role).
effects.py         Effect: a form at a site, with a driver and values.
sensors.py         A model without the errors of its sensors.
rescaled.py        A model whose constants are a little different.
stepping/          Simulation of one sampling interval and of whole records, with exact sensitivities.
ensemble/          The same for many members side by side.
filtering/         A model in innovations form: extended Kalman filter, smoother, k-step prediction, likelihood.
data/              Measured tables.
steady/            Steady states, and the state space at one.
step_size.py       Integration steps as short as a record asks for, and no shorter.
"""

from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.ensemble.ensemble import Ensemble, EnsembleRun, EnsembleSensitivities
from adaptive_flot.greybox.filtering.cramer_rao_bound import (
    LinearisedTrajectory,
    ParameterDrift,
    drift_of_time_profile,
    linearise_trajectory,
    posterior_cramer_rao_bound,
    random_walk,
)
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.quantities import KnownEffect
from adaptive_flot.greybox.scope import Site
from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.greybox.steady.steady_state import SteadyState, steady_state, steady_state_gradient
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.trajectory import Sensitivities, Trajectory

__all__ = [
    "Dataset",
    "Effect",
    "Ensemble",
    "EnsembleRun",
    "EnsembleSensitivities",
    "FloatArray",
    "KnownEffect",
    "LinearisedTrajectory",
    "Model",
    "Parameter",
    "ParameterDrift",
    "Quantity",
    "RecordSimulator",
    "Scope",
    "Sensitivities",
    "Site",
    "SteadyState",
    "Stepper",
    "Trajectory",
    "drift_of_time_profile",
    "linearise_trajectory",
    "posterior_cramer_rao_bound",
    "random_walk",
    "read_dataset",
    "steady_state",
    "steady_state_gradient",
    "without_sensor_effects",
]
