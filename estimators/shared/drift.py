"""How far parameters drift within an hour, as an option of an estimator gives it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray

Drift = float | Mapping[str, float]


def drift_of(setup: Setup, given: Drift, who: str) -> FloatArray:
    """Drift of each adapted parameter (q,) from one number or a mapping by name or symbol.

    Raises
    ------
    ModelError
        A negative drift, an unknown parameter, or one that is not adapted.
    """
    values = np.full(len(setup.parameters), 0.0 if isinstance(given, Mapping) else float(given))
    if isinstance(given, Mapping):
        for name, value in given.items():
            full = setup.model.parameters[setup.model.index("parameters", name)].name
            if full not in setup.parameters:
                raise ModelError(
                    f"{who}: drift of {name!r}, which is not adapted; {near_match(name, setup.parameters)}"
                )
            values[setup.parameters.index(full)] = value
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ModelError(f"{who}: drift_per_hour = {given}; give shares of 0 or more")
    return values
