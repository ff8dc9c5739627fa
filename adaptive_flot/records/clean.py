"""From the values of a tag to those of a quantity: bad codes, unit, delay, range, frozen and lone values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from adaptive_flot.errors import DataError, RangeError, located
from adaptive_flot.greybox.data.columns import shown
from adaptive_flot.greybox.data.wrong_unit import is_far_outside, units_that_fit
from adaptive_flot.greybox.quantities import FloatArray, Quantity
from adaptive_flot.records.reading.export import Instants, Signal
from adaptive_flot.records.tag_map import ConstantKeys, TagKeys
from adaptive_flot.records.units import convert, is_unit, read_unit

FATES = ("good", "code", "quality", "range", "frozen", "spike")
"""What became of a value: good, or why it counts as bad."""
NEIGHBOURS = 9
SPIKE = 8.0
"""Robust standard deviations from the median of the neighbours from which a value is a spike."""
QUARTER = 0.3186
"""Quantile 0.25 of the size of a standard normal variable."""
Fates = np.ndarray[Any, np.dtype[np.int8]]


@dataclass(frozen=True)
class Cleaned:
    """The values of one quantity at their own times.

    Attributes
    ----------
    quantity, keys
        What is measured, and how.
    unit
        Unit of the tag.
    time
        When the process had the value (n,) [ns since 1970, UTC]: the stamp less the delay.
    values
        Values (n,) in the quantity's unit; NaN where none was read.
    fates
        Index into FATES of each value (n,).
    raw
        The same values in the tag's unit (n,), NaN where none was read.
    repeats
        Values left out because they only repeat the one before.
    repeated
        Values left out because a later row of the file has another for the same time.
    constant
        Whether it is no signal but one value that the map gives: it has no time of its own.
    """

    quantity: Quantity
    keys: TagKeys
    unit: str
    time: Instants
    values: FloatArray
    fates: Fates
    raw: FloatArray
    repeats: int = 0
    repeated: int = 0
    constant: bool = False

    @property
    def good(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Mask (n,) of the values that count."""
        mask: np.ndarray[Any, np.dtype[np.bool_]] = self.fates == 0
        return mask

    def count(self, fate: str) -> int:
        """Number of values with one fate."""
        return int((self.fates == FATES.index(fate)).sum())


def clean(signal: Signal, quantity: Quantity, keys: TagKeys, file: Path) -> Cleaned:
    """Judge each value of a signal, and convert it.

    Raises
    ------
    DataError
        A text that the map does not list as bad, no unit, or another unit than the file says.
    RangeError
        The median is far outside what is possible, and another unit would put it right.
    """
    where = f"{file}: {quantity.name}: tag {signal.tag!r}"
    unknown = [code for code in signal.codes if code not in keys.bad]
    if unknown:
        line = signal.examples.get(unknown[0])
        raise DataError(
            f"{where}, line {line}: {shown(unknown[0])} is no number ({signal.codes[unknown[0]]} in all); if it stands "
            f"for no value, add it to the map: bad: [{unknown[0]}]"
        )
    unit = _unit(signal, quantity, keys, where)
    fates = np.zeros(len(signal), dtype=np.int8)
    fates[~np.isfinite(signal.values)] = FATES.index("code") if signal.codes else FATES.index("quality")
    if signal.codes and signal.poor:  # a text among values of poor quality is counted with them
        fates[~np.isfinite(signal.values)] = FATES.index("quality")
    numbers = np.array([float(c) for c in keys.bad if _is_number(c)])
    fates[np.isin(signal.values, numbers)] = FATES.index("code")
    with located(where):
        values = convert(signal.values, unit, quantity.unit)
    _check_unit(values[fates == 0], quantity, unit, where)
    low, high = (
        (quantity.lower, quantity.upper)
        if keys.range is None
        else np.sort(convert(np.array(keys.range), unit, quantity.unit))
    )
    fates[(fates == 0) & ~((values >= low) & (values <= high))] = FATES.index("range")
    time = signal.time - round(keys.delay_s * 1e9)
    if keys.frozen_s is not None:
        good = np.flatnonzero(fates == 0)
        fates[good[_frozen(time[good], values[good], keys.frozen_s)]] = FATES.index("frozen")
    if keys.spikes == "drop":
        good = np.flatnonzero(fates == 0)
        fates[good[spikes(values[good])]] = FATES.index("spike")
    if not (fates == 0).any():
        raise DataError(f"{where} has no good value; check tag, bad codes and range in the map")
    fresh = np.ones(len(values), bool)
    if keys.repeats == "drop":
        good = np.flatnonzero(fates == 0)
        fresh[good[1:][np.diff(signal.values[good]) == 0]] = False
    return Cleaned(
        quantity,
        keys,
        unit,
        time[fresh],
        values[fresh],
        fates[fresh],
        signal.values[fresh],
        int((~fresh).sum()),
        signal.repeated,
    )


def constant(quantity: Quantity, keys: ConstantKeys, file: Path) -> Cleaned:
    """An input that nobody records, with the value that the map gives.

    Raises
    ------
    DataError
        Its unit is not one of the quantity.
    RangeError
        It is outside what is possible.
    """
    where = f"{file}: {quantity.name}: the map's constant"
    raw = np.array([keys.constant])
    with located(where):
        values = convert(raw, keys.unit, quantity.unit)
    if not quantity.lower <= values[0] <= quantity.upper:
        raise RangeError(
            f"{where} {keys.constant:g} {keys.unit} is {values[0]:g} {quantity.unit}, outside what is possible "
            f"([{quantity.lower:g}, {quantity.upper:g}] {quantity.unit}); correct value or unit in the map"
        )
    good = np.zeros(1, dtype=np.int8)
    shown_keys = TagKeys(tag="constant", unit=keys.unit)
    return Cleaned(quantity, shown_keys, keys.unit, np.zeros(1, dtype=np.int64), values, good, raw, constant=True)


def _is_number(code: str) -> bool:
    try:
        float(code)
    except ValueError:
        return False
    return True


def _unit(signal: Signal, quantity: Quantity, keys: TagKeys, where: str) -> str:
    if keys.unit is None:
        raise DataError(f"{where} has no unit; add it to the map, as 'unit: {quantity.unit}'")
    if signal.unit and is_unit(signal.unit) and read_unit(signal.unit) != read_unit(keys.unit):
        raise DataError(
            f"{where} is in {signal.unit} by the file and in {keys.unit} by the map; correct the map, or the export"
        )
    return keys.unit


def _check_unit(values: FloatArray, quantity: Quantity, unit: str, where: str) -> None:
    if not is_far_outside(quantity, values):
        return
    middle = float(np.median(values))
    given = float(convert(np.array([middle]), quantity.unit, unit)[0])
    fitting = units_that_fit(quantity, given)
    low, high = quantity.lower, quantity.upper
    hint = (
        f"in {next(iter(fitting))} it would be {next(iter(fitting.values())):g} {quantity.unit}: write unit: "
        f'"{next(iter(fitting))}"'
        if fitting
        else "correct tag or unit in the map"
    )
    raise RangeError(
        f"{where}: the median {given:g} {unit} is {middle:g} {quantity.unit}, outside what is possible or usual "
        f"([{low:g}, {high:g}] {quantity.unit}); {hint}"
    )


def _frozen(time: Instants, values: FloatArray, longest: float) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Mask of values that repeat the one before, in runs of equal values that last longer than `longest` [s]."""
    mask = np.zeros(len(values), bool)
    for start, stop in runs_of_equal(values):
        if time[stop - 1] - time[start] > longest * 1e9:
            mask[start + 1 : stop] = True
    return mask


def runs_of_equal(values: FloatArray) -> list[tuple[int, int]]:
    """First and one past the last place of each run of two or more equal values (n,).

    >>> runs_of_equal(np.array([1.0, 1.0, 2.0, 3.0, 3.0, 3.0]))
    [(0, 2), (3, 6)]
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0) + 1, [len(values)]])
    long = np.flatnonzero(np.diff(edges) > 1)
    return list(zip(edges[long].tolist(), edges[long + 1].tolist(), strict=True))


def spikes(values: FloatArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Mask of values (n,) far from the median m of their neighbours (Hampel's filter), as in discovery's screening.

    ::

        |y - m| > max(8 s, quantile 0.95 of m - quantile 0.05 of m),    s = quantile 0.25 of |y - m| / 0.3186

    Far is more than eight times the noise, and more than what the signal itself does. Five or more in a row are a step.
    Davies & Gather, *J. Am. Statist. Assoc.* 88 (1993) 782.
    """
    if len(values) < NEIGHBOURS or np.ptp(values) == 0:
        return np.zeros(len(values), bool)
    middle = median_filter(values, NEIGHBOURS, mode="nearest")
    away = np.abs(values - middle)
    noise = float(np.quantile(away, 0.25)) / QUARTER
    own = float(np.quantile(middle, 0.95) - np.quantile(middle, 0.05))
    far: np.ndarray[Any, np.dtype[np.bool_]] = (away > max(SPIKE * noise, own)) & (away > 0)
    return far
