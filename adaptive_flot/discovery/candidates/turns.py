"""A change that turns with the sign of a signal, as dry friction does with that of a speed: where it makes sense."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import FloatArray, Model

LEAST_TURNED = 0.05
"""A signal goes both ways where it has either sign in more than this share of the rows."""
TURN = 0.02
"""Width over which a change turns with the sign of its driver, as a share of the driver's ordinary size."""
ALIKE = 0.95
"""Share of rows in which a value has the sign of a signal, or the other one, where it turns with it."""


def turns(values: FloatArray) -> bool:
    """Whether a signal (N,) goes both ways, in a fair share of the rows each."""
    return bool(min(np.mean(values < 0), np.mean(values > 0)) > LEAST_TURNED)


def turns_with(value: FloatArray, driver: FloatArray) -> bool:
    """Whether a value (N,) has its zero where a signal has: what turns there is then added, and no factor."""
    return bool(abs(np.mean(np.sign(value) * np.sign(driver))) > 2 * ALIKE - 1)


def has_sign(model: Model, driver: str) -> bool:
    """Whether the zero of a signal means something: that of a temperature is a matter of its unit."""
    quantities = (*model.inputs, *model.states, *model.signals)
    return not any(q.zero_is_arbitrary for q in quantities if q.name == driver)


def turning(site: str, driver: str, values: FloatArray, mode: Mode | None = None) -> Effect:
    """The change at a site over a signal that goes both ways, with a width from its ordinary size."""
    width = TURN * float(np.quantile(np.abs(values), 0.9))
    return Effect(site, driver, "direction", {"width": width}, {"scale": width}, mode=mode)
