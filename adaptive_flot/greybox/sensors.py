"""Effects on instruments: they change what is shown, not what is.

A site whose name ends in `_sensor` is an instrument. Who acts on a quantity (a limit, a price, an account) wants it as
it is; who compares with measurements wants it as it is shown.
"""

from __future__ import annotations

from adaptive_flot.greybox.model import Model

SENSOR = "_sensor"


def without_sensor_effects(model: Model) -> Model:
    """Return a model whose outputs are the true ones: the model itself where it has no effect on a sensor.

    Its states and parameters are among the model's, in the same order. Use it for outputs only: a control loop of the
    process that reads a sensor would act on what is.
    """
    kept = [effect for effect in model.effects if not effect.site.endswith(SENSOR)]
    return model if len(kept) == len(model.effects) else model.without_effects().with_effects(kept)
