"""The grey-box engine: models, steppers, measured tables. It knows nothing of flotation."""

from adaptive_flot.greybox.data.dataset import Dataset, read_dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper, Trajectory

__all__ = [
    "Dataset",
    "FloatArray",
    "Model",
    "Parameter",
    "Quantity",
    "Scope",
    "Stepper",
    "Trajectory",
    "read_dataset",
    "steady_state",
]
