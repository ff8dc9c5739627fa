"""Values that are in another unit than their column says: percent for a fraction, millimetres for metres."""

from __future__ import annotations

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.quantities import FloatArray, Quantity

OTHER_UNITS = {
    "-": {"%": 1e-2, "ppm": 1e-6},
    "m": {"mm": 1e-3, "cm": 1e-2},
    "m3/s": {"L/min": 1e-3 / 60, "m3/h": 1 / 3600, "L/s": 1e-3},
    "kg": {"t": 1e3, "g": 1e-3},
    "kg/m3": {"g/m3": 1e-3, "mg/m3": 1e-6},
    "g/L": {"mg/L": 1e-3},
    "kg/s": {"t/h": 1e3 / 3600, "kg/h": 1 / 3600, "g/s": 1e-3},
    "Pa": {"kPa": 1e3, "bar": 1e5},
    "bar": {"kPa": 1e-2, "mbar": 1e-3, "Pa": 1e-5},
    "s": {"min": 60.0, "h": 3600.0},
    "V": {"mV": 1e-3},
    "A": {"mA": 1e-3},
    "W": {"kW": 1e3},
    "kW": {"W": 1e-3, "MW": 1e3},
    "1/s": {"1/min": 1 / 60},
}
"""Units that plants use instead of a model's, and what one of them is in it."""
OFFSETS = {
    "K": {"degC": (1.0, 273.15), "degF": (5 / 9, 273.15 - 32 * 5 / 9)},
    "degC": {"K": (1.0, -273.15), "degF": (5 / 9, -32 * 5 / 9)},
}
"""Units whose zero is another one: what one of them is in a model's unit, and where their zero is."""
SPELT = {"%": ("pct", "percent"), "degC": ("C",), "degF": ("F",), "L/min": ("lpm",)}
"""How else the suffix of a column has a unit."""
FAR = 20.0
"""A median so many times as large as what is usual is of another unit."""


def other_units(quantity: Quantity) -> dict[str, float]:
    """Units that plants may use for a quantity, and what one of them is in its own.

    A number without unit that may be larger than 1, as pH or a scaled flow, is no fraction: it has no others.
    """
    if quantity.unit == "-" and quantity.usual is None and quantity.upper > 1:
        return {}
    return OTHER_UNITS.get(quantity.unit, {})


def units_that_fit(quantity: Quantity, value: float) -> dict[str, float]:
    """Units of plants in which a value would be one of ordinary operation, with that value in the quantity's unit.

    Examples
    --------
    >>> level = Quantity("level", "m", "pulp height", 0.0, 0.48, usual=(0.15, 0.48))
    >>> units_that_fit(level, 380.0)
    {'mm': 0.38}
    """
    low, high = quantity.usual or (quantity.lower, quantity.upper)
    found = {unit: value * factor for unit, factor in other_units(quantity).items()}
    found |= {unit: value * factor + offset for unit, (factor, offset) in OFFSETS.get(quantity.unit, {}).items()}
    return {unit: inside for unit, inside in found.items() if low <= inside <= high}


def is_far_outside(quantity: Quantity, values: FloatArray) -> bool:
    """Whether the median of values (N,) leaves the physical range, or what is usual by a factor of FAR."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return False
    middle = float(np.median(finite))
    usual = FAR * abs(quantity.usual[1]) if quantity.usual else np.inf
    return not quantity.lower <= middle <= quantity.upper or abs(middle) > usual


def check_unit(quantity: Quantity, values: FloatArray, where: str) -> None:
    """Refuse values (N,) that are far outside, where another unit would put them right.

    What is outside for another reason passes: one wrong value, a sensor with an offset.

    Raises
    ------
    RangeError
        The median is outside the physical range (or FAR times what is usual), and a unit of plants would fit.
    """
    if not is_far_outside(quantity, values):
        return
    middle = float(np.median(values[np.isfinite(values)]))
    fitting = units_that_fit(quantity, middle)
    if fitting:
        said = "is a fraction" if quantity.unit == "-" else f"is in {quantity.unit}"
        ways = [
            f"in {unit} that would be {inside:g}: {_converted(quantity.unit, unit)}, or import it with "
            f"'unit: \"{unit}\"'"
            for unit, inside in fitting.items()
        ]
        which = "" if len(ways) == 1 else f". {len(ways)} units would fit, so look up which it is"
        raise RangeError(
            f"{where}: {quantity.name} {said}, and the median of its values is {middle:g}; {'; '.join(ways)}{which}"
        )


def conversion_of(unit: str, suffix: str) -> str | None:
    """What to do with a column of a table that carries another unit as its suffix, in words; None where not known.

    >>> conversion_of("V", "mV"), conversion_of("m3/s", "L_min"), conversion_of("K", "C"), conversion_of("V", "volt")
    ('multiply the column by 0.001', 'multiply the column by 1.66667e-05', 'add 273.15 to the column', None)
    """
    known = (*OTHER_UNITS.get(unit, {}), *OFFSETS.get(unit, {}))
    meant = {spelt.lower(): other for other in known for spelt in (other.replace("/", "_"), *SPELT.get(other, ()))}
    other = meant.get(suffix.lower())
    return None if other is None else _converted(unit, other)


def _converted(unit: str, other: str) -> str:
    """What to do with a column, in words."""
    if other in OFFSETS.get(unit, {}):
        factor, offset = OFFSETS[unit][other]
        moved = f"add {offset:g}" if offset > 0 else f"subtract {-offset:g}"
        return (
            f"{moved} {'to' if offset > 0 else 'from'} the column"
            if factor == 1
            else f"multiply the column by {factor:g} and {moved}"
        )
    return f"multiply the column by {OTHER_UNITS[unit][other]:g}"
