"""What a plant's outputs are, whatever effects on its sensors make them show."""

from __future__ import annotations

from adaptive_flot.greybox.fastcall import FastCall
from adaptive_flot.greybox.model import FloatArray, Model

SENSOR = "_sensor"
"""A site whose name ends so is an instrument: an effect there changes what is shown."""


class TrueOutputs:
    """Outputs of a model without its effects on sensors; states and all other effects are the model's.

    Parameters
    ----------
    model
        The plant's model.
    """

    def __init__(self, model: Model) -> None:
        kept = [effect for effect in model.effects if not effect.site.endswith(SENSOR)]
        self._ode = None
        if len(kept) < len(model.effects):
            clean = model.without_effects().with_effects(kept)
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
