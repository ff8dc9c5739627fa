"""The data screening: what in a record can not be used, said before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from adaptive_flot.discovery.record.noise import is_dense
from adaptive_flot.discovery.record.noise_level import NoiseChange
from adaptive_flot.discovery.record.problem import BoolArray
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.data.wrong_unit import is_far_outside
from adaptive_flot.greybox.model import FloatArray, Model, Quantity

FEWEST_ROWS = 200
FROZEN_ROWS = 30
"""So many equal values in a row, in a signal that else changes from sample to sample, are a frozen sensor."""
SLOW = 1.5
"""Steps into and out of a run of equal values, in the least steps of a signal, where a slow curve turns."""
MOST_FROZEN = 0.3
"""An input that stands still for a larger share of the record is moved in steps."""
CLIPPED_SHARE = 0.03
"""Share of a signal that sits exactly at its largest or smallest value from which it counts as clipped."""
LEAST_MOVE = 5e-3
"""Where no input spreads by this share of its mean, nothing moves."""
LEAST_RANGE = 0.02
"""One that spreads by less than this share of its mean tells nothing about a dependence."""
LEAST_OF_SCALE = 0.1
"""The same for a temperature, as a share of its scale: shares of its value depend on the unit."""
OUTLIER_SHARE = 0.15
"""Share of samples far outside from which a signal is an outlier storm."""
MOST_STOPS = 3
"""An input that stands still more often is held in between, as a set-point is: it says nothing of a sensor."""
MOST_UNRECORDED = 3
"""More holes than these are how the record is, and say nothing of one place."""
NEIGHBOURS = 9
QUARTER = 0.3186
"""Quantile 0.25 of the size of a standard normal variable."""


@dataclass(frozen=True)
class Suspect:
    """A part of the record, first and last time [s], in which something is wrong with a sensor."""

    start: float
    end: float
    what: str

    def __str__(self) -> str:
        when = f"at {self.start:g} s" if self.start == self.end else f"from {self.start:g} to {self.end:g} s"
        return f"{self.what} {when}"


@dataclass(frozen=True)
class Screening:
    """Result of the data screening.

    Attributes
    ----------
    record
        The record with unusable measurements set to NaN.
    reasons
        Why the record says too little; empty when it can be judged.
    notes
        What was left out, in words.
    suspects
        Parts of the record in which a sensor says nothing: an event that seems to begin there is doubtful.
    """

    record: Dataset
    reasons: tuple[str, ...]
    notes: tuple[str, ...]
    suspects: tuple[Suspect, ...] = ()

    def __str__(self) -> str:
        state = "insufficient: " + "; ".join(self.reasons) if self.reasons else "usable"
        return f"data screening: {state}" + "".join(f"\n  {n}" for n in self.notes)


def screen(record: Dataset, model: Model) -> Screening:
    """Check a record: length, gaps, frozen and clipped sensors, outliers, inputs that move."""
    record, found, suspects = clean_outputs(record, model)
    outputs = record.outputs
    notes: list[str] = [*record.notes, *found]
    reasons: list[str] = []
    measured = [q.name for j, q in enumerate(model.outputs) if np.isfinite(outputs[:, j]).any()]
    usable = int(np.isfinite(outputs).any(axis=1).sum())
    if not measured:
        reasons.append("no output has a usable measurement")
    elif usable < FEWEST_ROWS:
        reasons.append(f"only {usable} usable samples; {FEWEST_ROWS} are needed")
    inputs = list(zip(model.inputs, record.inputs.T, strict=True))
    moving = [q.name for q, u in inputs if _moves(u, LEAST_MOVE, q)]
    still = [q.name for q, u in inputs if not _moves(u, LEAST_RANGE, q)]
    if not moving:
        reasons.append(f"no input moves ({', '.join(still)}): nothing that depends on them can be told from a constant")
    elif still:
        one = len(still) == 1
        moves, it = ("moves", "it") if one else ("move", "them")
        notes.append(f"{', '.join(still)} hardly {moves}: no dependence on {it} can be told")
    if measured and not reasons and all(_flat(outputs[:, j]) for j in range(outputs.shape[1])):
        reasons.append("every measured output is constant")
    return Screening(record, tuple(reasons), tuple(notes), suspects)


def clean_outputs(record: Dataset, model: Model) -> tuple[Dataset, tuple[str, ...], tuple[Suspect, ...]]:
    """The record without measurements that can not be used, what was left out in words, and where that was.

    Outputs outside their physical range are kept, with a word: no unit of plants puts them right, or `check_unit` would
    have refused them, so it may be an offset.
    """
    outputs, notes, suspects = record.outputs.copy(), [], []
    for j, q in enumerate(model.outputs):
        before = np.isfinite(outputs[:, j])
        if not before.any():
            continue
        notes += out_of_range(q, outputs[:, j])
        notes += _clean(outputs[:, j], q.name, q.name in model.edges)
        suspects += [
            Suspect(float(record.time[a]), float(record.time[b - 1]), f"{q.name} says nothing")
            for a, b in runs_of(~np.isfinite(outputs[:, j]), FROZEN_ROWS if is_dense(outputs[:, j]) else len(before))
        ]
    for q, u in zip(model.inputs, record.inputs.T, strict=True):
        stopped = _frozen(u) & (u > u.min()) & (u < u.max()) & (u != 0)  # a valve may stay shut, a battery at rest
        stops = runs_of(stopped, FROZEN_ROWS)
        for a, b in stops if stopped.mean() < MOST_FROZEN and len(stops) <= MOST_STOPS else ():
            suspects.append(Suspect(float(record.time[a]), float(record.time[b - 1]), f"{q.name} stands still"))
            notes.append(f"{suspects[-1]}, where it else changes from row to row: a sensor that had stopped?")
    suspects += _unrecorded(record)
    return replace(record, outputs=outputs), tuple(notes), tuple(suspects)


def _unrecorded(record: Dataset) -> list[Suspect]:
    """Where a record that else has a measurement in every row has none for a few; nothing where that happens often."""
    empty = np.asarray(~np.isfinite(record.outputs).any(axis=1))
    found = runs_of(empty, 1)
    if len(found) > MOST_UNRECORDED or empty.mean() > OUTLIER_SHARE:
        return []
    return [
        Suspect(float(record.time[a]), float(record.time[b - 1]), "no row was recorded")
        for a, b in found
        if b - a < FROZEN_ROWS
    ]


def where_noise_changes(
    changes: Sequence[NoiseChange], measured: Sequence[str], time: FloatArray
) -> tuple[Suspect, ...]:
    """Times [s] at which the noise changes, with a word; `measured` are the names of the outputs, `time` is (N,)."""
    found = []
    for change in changes:
        words = f"{change.ratio:.2g} times as large" if change.ratio > 1 else f"{1 / change.ratio:.2g} times smaller"
        at = float(time[change.row])
        found.append(Suspect(at, at, f"the noise of {measured[change.column]} becomes {words}"))
    return tuple(found)


def out_of_range(quantity: Quantity, values: FloatArray) -> list[str]:
    """A word on values (N,) outside their physical range; none where they are inside."""
    if not is_far_outside(quantity, values):
        return []
    middle, unit = float(np.nanmedian(values)), quantity.unit
    where = f"the range [{quantity.lower:g}, {quantity.upper:g}] {unit}"
    return [f"{quantity.name}: the median, {middle:g} {unit}, is outside {where}: check its unit and its zero"]


def runs_of(mask: BoolArray, least: int) -> list[tuple[int, int]]:
    """First row, and the row after the last, of each run of at least so many rows of a mask (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]


def _moves(u: FloatArray, share: float, quantity: Quantity) -> bool:
    spread = float(np.quantile(u, 0.98) - np.quantile(u, 0.02))
    if quantity.zero_is_arbitrary:
        return spread > LEAST_OF_SCALE * quantity.scale
    return spread > share * max(float(np.mean(np.abs(u))), 1e-300)


def _flat(y: FloatArray) -> bool:
    seen = y[np.isfinite(y)]
    return seen.size == 0 or float(np.ptp(seen)) == 0.0


def _clean(y: FloatArray, name: str, edges: bool = False) -> list[str]:
    """Set unusable samples of one output to NaN, in place; say what they were. `edges`: the process may stay at one."""
    notes = []
    present = np.flatnonzero(np.isfinite(y))
    values = y[present]
    if len(values) < FEWEST_ROWS or np.ptp(values) == 0:
        if not len(values) or np.ptp(values) != 0:
            return []
        y[:] = np.nan
        return [f"{name} is constant: left out"]
    frozen = _frozen(values)
    if edges:
        frozen = np.logical_and(frozen, (values < values.max()) & (values > values.min()))
    if frozen.any():
        y[present[frozen]] = np.nan
        notes.append(f"{name}: {int(frozen.sum())} samples of a frozen sensor left out")
    values = y[np.isfinite(y)]
    for edge, word in ((values.max(), "highest"), (values.min(), "lowest")):
        at = np.isclose(y, edge, rtol=0, atol=1e-9 * float(np.ptp(values)))
        if at.sum() > max(CLIPPED_SHARE * len(values), 5) and len(np.unique(values)) > 0.2 * len(values):
            if edges:
                notes.append(f"{name}: {int(at.sum())} samples at the {word} value kept, as the process may stay there")
                continue
            y[at] = np.nan
            notes.append(f"{name}: {int(at.sum())} samples clipped at the {word} value left out")
    values = y[np.isfinite(y)]
    storm = _outliers(values)
    if storm > OUTLIER_SHARE:
        y[:] = np.nan
        notes.append(f"{name}: an outlier storm ({100 * storm:.0f} % of the samples), left out")
    return notes


def _outliers(values: FloatArray) -> float:
    """Share of samples far from the median m of their neighbours (Hampel's filter).

    With the quantile 0.25 of |y - m| over that of a standard normal variable as the noise s::

        |y - m| > max(8 s, quantile 0.9 of m - quantile 0.1 of m)

    Far is more than eight times the noise and more than what the signal itself does: fits bear smaller ones. The noise
    is judged by the quietest quarter of the deviations, since in a storm their median is wild. Davies & Gather, *J. Am.
    Statist. Assoc.* 88 (1993) 782. It must be as far from both samples beside it: what swings within NEIGHBOURS rows
    has a median that stands still, and goes there step by step.
    """
    middle = median_filter(values, NEIGHBOURS, mode="nearest")
    away = np.abs(values - middle)
    noise = float(np.quantile(away, 0.25)) / QUARTER
    step = np.abs(np.diff(values))
    away = np.minimum(away, np.minimum(np.append(step, np.inf), np.append(np.inf, step)))
    return float(np.mean(away > max(8 * noise, float(np.quantile(middle, 0.9) - np.quantile(middle, 0.1)))))


def _turns(step: FloatArray, a: int, b: int, least: float) -> bool:
    """Whether a run of equal values, steps a to b, is left to the side from where it was reached, by least steps."""
    if a == 0 or b >= len(step):
        return False
    into, out = float(step[a - 1]), float(step[b])
    return into * out < 0 and max(abs(into), abs(out)) <= least


def _frozen(values: FloatArray) -> BoolArray:
    """Mask of samples in long runs of one value, if most other samples differ from their neighbours.

    Not where a slow curve turns: there its rounded values stay, and go into the run and out of it by the least step
    that they know. A sensor that had stopped jumps to where the process is by then.
    """
    step = np.diff(values)
    same = step == 0
    least = SLOW * float(np.min(np.abs(step[~same]), initial=np.inf))
    mask = np.zeros(len(values), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    runs = list(zip(edges[::2], edges[1::2], strict=True))
    long = [(a, b) for a, b in runs if b - a >= FROZEN_ROWS and not _turns(step, a, b, least)]
    elsewhere = same.copy()
    for a, b in long:
        elsewhere[a:b] = False
    rest = len(same) - sum(b - a for a, b in long) - (len(long) + 1)  # the steps into and out of a run tell nothing
    # a quantised or held signal repeats itself all the time
    if rest > FROZEN_ROWS and elsewhere.sum() / rest < 0.5:
        for a, b in long:
            mask[a + 1 : b + 1] = True
    return mask
