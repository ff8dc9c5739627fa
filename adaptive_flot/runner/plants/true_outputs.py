"""What a plant's outputs are, whatever effects on its sensors make them show."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.sensors import without_sensor_effects
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall


class TrueOutputs:
    """Outputs of a model without its effects on sensors; states and all other effects are the model's.

    Parameters
    ----------
    model
        The plant's model.
    """

    def __init__(self, model: Model) -> None:
        self._ode = None
        clean = without_sensor_effects(model)
        if clean is not model:
            self._states = model.indices("states", clean.names("states"))
            self._parameters = model.indices("parameters", clean.names("parameters"))
            self._ode = FastCall(clean.ode)

    def __call__(
        self, shown: FloatArray, time: float, state: FloatArray, inputs: FloatArray, parameters: FloatArray
    ) -> FloatArray:
        """True outputs (ny,) where `shown` (ny,) is shown; time in s, state (nx,), inputs (nu,), parameters (np,)."""
        if self._ode is None:
            return shown
        return self._ode(time, state[self._states], inputs, parameters[self._parameters])[1]

    def of_rows(
        self, shown: FloatArray, time: FloatArray, states: FloatArray, inputs: FloatArray, parameters: FloatArray
    ) -> FloatArray:
        """The same of N rows (N, ny), each argument with an axis of rows before its own."""
        if self._ode is None:
            return shown
        rows = zip(shown, time.tolist(), states, inputs, parameters, strict=True)
        return np.array([self(*row) for row in rows])
