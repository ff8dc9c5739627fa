"""Units and powers of ten in labels."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.quantities import FloatArray

_TIME_UNITS = ((3 * 86400.0, "d", 86400.0), (3 * 3600.0, "h", 3600.0))


def exponent(*series: FloatArray) -> int:
    """Power of ten to take out of an axis: 0 for sizes that read well as they are.

    >>> exponent(np.array([9.05e-4, 2.17e-3])), exponent(np.array([0.3])), exponent(np.array([np.nan]))
    (-3, 0, 0)
    """
    largest = max((float(np.max(np.abs(s[np.isfinite(s)]), initial=0.0)) for s in series), default=0.0)
    if largest == 0.0 or 0.01 <= largest < 1e4:
        return 0
    return int(np.floor(np.log10(largest)))


def unit_text(unit: str, power: int = 0) -> str:
    """Return a unit as the axis shows it, with the power of ten taken out of the numbers.

    >>> unit_text("m3/s", -3), unit_text("-"), unit_text("m^n/s"), unit_text("-", -3)
    ('10⁻³ m³/s', '–', 'mⁿ/s', '10⁻³')
    """
    raised = str.maketrans("0123456789-n.", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ⁿ·")
    text = "" if unit == "-" else unit
    for base in ("m", "s", "V"):
        for old in ("2", "3", "^n", "^0.5"):
            text = text.replace(base + old, base + old.lstrip("^").translate(raised))
    factor = f"10{str(power).translate(raised)}" if power else ""
    return " ".join(filter(None, (factor, text))) or "–"


def amount(value: float, unit: str) -> str:
    """Value and unit as text.

    >>> amount(1.67e-4, "m3/s"), amount(0.5, "-")
    ('1.67 × 10⁻⁴ m³/s', '0.5')
    """
    power = exponent(np.array([value]))
    scaled = f"{value * 10.0**-power:.4g}" + (" ×" if power else "")
    return scaled if unit == "-" and not power else f"{scaled} {unit_text(unit, power)}"


def with_std(value: float, std: float, unit: str) -> str:
    """Value and standard deviation in one unit, with two digits of the standard deviation.

    >>> with_std(5.974e-4, 4.54e-6, "m^n/s"), with_std(1.0308, 0.00137, "-")
    ('(5.974 ± 0.045) × 10⁻⁴ mⁿ/s', '1.0308 ± 0.0014')
    """
    power = exponent(np.array([value]))
    scaled, wide = (v * 10.0**-power for v in (value, std))
    digits = max(0, 1 - int(np.floor(np.log10(wide)))) if np.isfinite(wide) and wide > 0 else 4
    both = f"{scaled:.{digits}f} ± {wide:.{digits}f}"
    if unit == "-" and not power:
        return both
    return f"({both}) × {unit_text(unit, power)}" if power else f"({both}) {unit_text(unit)}"


def time_unit(span: float) -> tuple[str, float]:
    """Unit of a time axis and its seconds: days from three days on, hours from three hours on.

    >>> time_unit(3600.0), time_unit(86400.0)
    (('s', 1.0), ('h', 3600.0))
    """
    return next(((name, seconds) for least, name, seconds in _TIME_UNITS if span >= least), ("s", 1.0))
