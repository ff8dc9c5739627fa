"""Effects on sensors: they change what is shown, not what is.

A sensor is a site of the role "sensor", whatever its name. A limit, a price or an account needs a quantity as it is. A
comparison with measurements needs it as it is shown.
"""

from __future__ import annotations

from adaptive_flot.greybox.model import Model


def without_sensor_effects(model: Model) -> Model:
    """Return a model whose outputs are the true ones: the model itself where it has no effect on a sensor.

    Its states and parameters are among the model's, in the same order. Use it for outputs only: a control loop of the
    process that reads a sensor would act on the true value.
    """
    sensors = {site.name for site in model.sites if site.role == "sensor"}
    others = [effect for effect in model.effects if effect.site not in sensors]
    return model if len(others) == len(model.effects) else model.without_effects().with_effects(others)
