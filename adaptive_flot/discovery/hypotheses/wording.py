"""A hypothesis in words: size, direction, unit."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import Tested
from adaptive_flot.greybox.model import Model


def words_of(model: Model, tested: Tested) -> str:
    """One sentence without its full stop: what is the matter and by how much."""
    h = tested.hypothesis
    assert h is not None  # the model as it is has no words
    values = dict(zip(h.free, (tested.fit.value(name) for name in h.parameters), strict=True))
    site = next(s for s in model.sites if s.name == h.site)
    name, unit = site.name.replace("_", " "), f" {site.unit}" if site.unit and site.unit != "-" else ""
    first = next(iter(values.values()))
    if h.kind == "stuck":
        return f"{name} stays at {first:.3g}{unit}, whatever is asked"
    if h.kind == "leaks":
        return f"{name} does not go below {first:.3g}{unit}"
    if h.kind == "range":
        return f"{name} does not go above {first:.3g}{unit}"
    if h.kind == "gain":
        return f"{name} is {_factor(first)}"
    if h.kind == "offset":
        verb = "shows" if site.role == "sensor" else "is"
        return f"{name} {verb} {abs(first):.3g}{unit} too {'much' if first > 0 else 'little'}"
    if h.kind == "span":
        return (
            f"{name} is wrongly calibrated: {values['offset']:+.3g}{unit} in the middle of its range, "
            f"and a span {_factor(float(np.log(max(1 + values['slope'], 1e-9))))}"
        )
    if h.kind == "sign":
        return f"{name} does not see the sign: it shows the absolute value ({100 * first:.0f} % of the way)"
    if h.kind == "lag":
        return f"{name} answers late, with a time constant of {first:.3g} s"
    if h.kind == "store":
        tau = values["time_constant"]
        return f"{name} lacks a second store behind {h.driver.replace('_', ' ')}, with a time constant of {tau:.3g} s"
    change = values["value_2"] - values["value_1"]
    low, high = h.effect.settings["knots"]  # type: ignore[misc]
    driver = h.driver.replace("_", " ")
    return f"{name} depends on {driver}: {_factor(change)} at {driver} {high:.3g} than at {low:.3g}"


def _factor(log: float) -> str:
    factor = float(np.exp(log))
    if factor < 0.02:
        return "next to nothing"
    if 0.5 < factor < 2.0:
        return f"{abs(100 * (factor - 1)):.0f} % {'larger' if factor > 1 else 'smaller'}"
    return f"{factor:.2g} times as large"
