"""Units as plants write them, and what they come to in the unit of a quantity.

Pint does the arithmetic. It is loaded when the first unit is read: it takes a while.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from adaptive_flot.errors import DataError

if TYPE_CHECKING:  # the live link reads maps too, and has no need of the engine's libraries
    import pint

    from adaptive_flot.greybox.quantities import FloatArray

PLAIN = {
    **dict.fromkeys(("-", "", "1", "frac", "fraction"), "dimensionless"),
    **dict.fromkeys(("%", "pct", "percent", "per cent", "wt%", "%w/w", "vol%"), "percent"),
    **dict.fromkeys(("degc", "deg c", "°c", "grad c"), "degree_Celsius"),
    **dict.fromkeys(("degf", "deg f", "°f"), "degree_Fahrenheit"),
    **dict.fromkeys(("lpm", "l/mn"), "liter/minute"),
    **dict.fromkeys(("lph",), "liter/hour"),
    **dict.fromkeys(("cmh", "cum/h", "cum/hr"), "meter**3/hour"),
    **dict.fromkeys(("gpm", "usgpm", "usgal/min"), "gallon/minute"),
    **dict.fromkeys(("cfm", "acfm"), "foot**3/minute"),
    **dict.fromkeys(("tph", "mtph"), "metric_ton/hour"),
    **dict.fromkeys(("cps",), "centipoise"),
    **dict.fromkeys(("rpm", "1/min", "u/min"), "1/minute"),
}
"""Spellings that Pint does not know, or takes for something else: `cfm` for centifermi, `rpm` for an angle."""
WORDS = {"hr": "hour", "hrs": "hour", "mins": "minute", "secs": "second", "l": "liter", "t": "metric_ton"}
"""Parts of a unit that Pint would not take, or not for what a plant means."""
NORMAL = re.compile(r"^(?:n|s)(?:m3|m³|m\^3|l|cm3)(?:/|$)|^scf|^sccm|^slpm|^nlpm", re.IGNORECASE)
"""Gas at normal conditions: no volume at the conditions of the cell."""


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


@cache
def read_unit(text: str) -> pint.Unit:
    """Unit behind a plant's or a model's spelling.

    Raises
    ------
    DataError
        Not a unit, or gas at normal conditions.
    """
    plain = " ".join(text.split()).replace("µ", "u")
    if NORMAL.match(plain.replace(" ", "")):
        raise DataError(
            f"unit {text!r} counts gas at normal conditions; convert it to the pressure and temperature of the cell, "
            "and give for example m3/h"
        )
    form = PLAIN.get(plain.lower()) or _for_pint(plain)
    try:
        return _registry().parse_units(form)  # type: ignore[no-any-return]
    except Exception as error:  # pint has a dozen kinds, some of them those of Python's tokenizer
        raise DataError(f"{text!r} is no unit; write one as L/min, m3/h, mm, % or -") from error


def _for_pint(text: str) -> str:
    spelt = text.replace("³", "3").replace("²", "2").replace("·", "*").replace("^", "")
    parts = re.split(r"([/*() ])", spelt)
    named = [WORDS.get(part.lower(), part) if part.isalpha() else part for part in parts]
    return re.sub(r"(?<=[A-Za-z])(-?\d)", r"**\1", "".join(named))


def is_unit(text: str) -> bool:
    """Whether a text is a unit that can be converted.

    >>> is_unit("L/min"), is_unit("FIC_101.PV")
    (True, False)
    """
    try:
        read_unit(text)
    except DataError:
        return False
    return True


def fits(unit: str, wanted: str) -> bool:
    """Whether values in one unit can be given in another.

    >>> fits("L/min", "m3/s"), fits("mm", "m3/s"), fits("%", "-")
    (True, False, True)
    """
    return bool(read_unit(unit).dimensionality == read_unit(wanted).dimensionality)


def convert(values: FloatArray, unit: str, wanted: str) -> FloatArray:
    """Values (N,) in another unit; also between scales with an offset, as degC and K.

    Raises
    ------
    DataError
        The two do not measure the same.

    Examples
    --------
    >>> convert(np.array([90.0]), "L/min", "m3/s").round(6).tolist()
    [0.0015]
    """
    given, asked = read_unit(unit), read_unit(wanted)
    if given.dimensionality != asked.dimensionality:
        raise DataError(f"unit {unit!r} can not be converted to {wanted!r}; correct the unit or the tag")
    if given == asked:
        return values
    found: FloatArray = np.asarray(_registry().Quantity(values, given).to(asked).magnitude, dtype=float)
    return found


def seconds(text: str) -> float:
    """Duration [s] of a text such as `10 s` or `1.5 min`.

    >>> seconds("90 s"), seconds("1.5 min"), seconds("250 ms")
    (90.0, 90.0, 0.25)

    Raises
    ------
    DataError
        Not a number with a unit of time.
    """
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]+)\s*", text)
    if found is None or not is_unit(found[2]) or not fits(found[2], "s"):
        raise DataError(f"{text!r} is no duration; write one as 10 s, 5 min or 1 h")
    return float(convert(np.array([float(found[1])]), found[2], "s")[0])
