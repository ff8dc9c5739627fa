"""The record as discovery sees it: rows in three interleaved splits, measured outputs, unknowns that are no effect."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.record.background import Background
from adaptive_flot.discovery.record.noise import Noise, fit_noise, white_noise
from adaptive_flot.discovery.record.noise_level import NoiseChange
from adaptive_flot.discovery.record.robust import CLIP
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.nodes import Nodes

BoolArray = NDArray[np.bool_]

CYCLE = ("estimate", "estimate", "confirm", "estimate", "report")
"""Splits of the record, in turn: 60 % to estimate, 20 % to confirm, 20 % to report. Blocks are interleaved in time, so
that an event at any time has rows of each kind around it."""
WITHOUT_REPORT = ("estimate", "estimate", "confirm", "estimate")
"""The same where a record of its own reports."""
CYCLES = 4


@dataclass(frozen=True)
class Problem:
    """A record prepared for fits.

    Attributes
    ----------
    record
        The whole record; inputs are never missing.
    columns
        Indices of the measured outputs (m,).
    adapted
        Names of the parameters that the estimator adapts; they are free in every alternative.
    splits
        Name of the split of each row (N,): "estimate", "confirm", "report" or "" for rows that are left out.
    weights
        Relative size of the noise of each measured output (N, m).
    floor
        Smallest noise believed (m,).
    whiten
        Whether residuals are whitened and clipped. Not where model error outweighs the noise by far: there a noise
        model would explain the error away, and its largest values are the physics that is looked for.
    site_sizes
        Ordinary size of a change at each site, in its unit (see `Responses.sizes`); empty before the first fit.
    absorbed
        Sites, each with a mode, whose constant change the adapted parameters take up along the model as it is. None is
        offered beside an effect either: there it would only put right what the shape of that one lacks.
    evenly_moved
        Measured outputs, as indices into `columns`, that move at even times only: see `record.even_steps`.
    noise_changes
        Outputs whose noise becomes several times as large, or as small, at some time; it is in the weights.
    deadline
        When searches and fits are to end, by `time.monotonic` [s]: they keep what they have come to.
    nodes
        Rows that a search simulates, where that makes no difference to speak of; None for all.
    background
        What is always a little wrong with the model; every fit estimates it beside its other unknowns. None without.
    """

    record: Dataset
    columns: tuple[int, ...]
    adapted: tuple[str, ...]
    splits: NDArray[np.str_]
    weights: FloatArray
    floor: FloatArray
    whiten: bool = True
    nodes: Nodes | None = None
    background: Background | None = None
    site_sizes: Mapping[str, float] = field(default_factory=dict)
    absorbed: frozenset[tuple[str, str]] = frozenset()
    evenly_moved: frozenset[int] = frozenset()
    noise_changes: tuple[NoiseChange, ...] = ()
    deadline: float = float("inf")

    @property
    def time_is_up(self) -> bool:
        """Whether the deadline has passed."""
        return time.monotonic() > self.deadline

    @property
    def clip(self) -> float:
        """Standard deviations up to which an innovation counts."""
        return CLIP if self.whiten else float("inf")

    def noise(self, weighted: FloatArray, rows: BoolArray) -> Noise:
        """Noise model of a weighted residual (N, m) on some rows (N,)."""
        return (fit_noise if self.whiten else white_noise)(weighted, rows, self.floor)

    def count(self, rows: BoolArray) -> int:
        """Number of measurements on some rows (N,)."""
        return int(np.isfinite(self.measured[rows]).sum())

    @property
    def measured(self) -> FloatArray:
        """Measured outputs (N, m), NaN where missing."""
        y: FloatArray = self.record.outputs[:, self.columns]
        return y

    def rows(self, *splits: str) -> BoolArray:
        """Mask (N,) of the rows in the named splits; all that are not left out when none is named."""
        mask: BoolArray = np.isin(self.splits, splits) if splits else self.splits != ""
        return mask

    @property
    def first_row(self) -> int:
        """First row of any split; those before are left out, since the initial state is not known."""
        return int(np.argmax(self.rows()))

    def spans(self, split: str) -> tuple[tuple[float, float], ...]:
        """First and last time [s] of each contiguous part of a split."""
        inside = np.concatenate([[False], self.rows(split), [False]]).astype(int)
        starts, stops = (np.flatnonzero(np.diff(inside) == sign) for sign in (1, -1))
        time = self.record.time
        return tuple((float(time[a]), float(time[b - 1])) for a, b in zip(starts, stops, strict=True))


def make_problem(
    record: Dataset,
    model: Model,
    adapted: tuple[str, ...],
    *,
    burn_in: int,
    guard: int,
    cycles: int = CYCLES,
    cycle: Sequence[str] = CYCLE,
) -> Problem:
    """Split a record.

    Parameters
    ----------
    record, model
        The record and the model it belongs to.
    adapted
        Names of the adapted parameters.
    burn_in
        Rows at the start that no split gets, because the initial state is not known.
    guard
        Rows left out at each border between splits.
    cycle
        Splits of one cycle.
    cycles
        How often the pattern of splits repeats.
    """
    columns = tuple(model.index("outputs", name) for name in record.measured(model))
    splits = split_names(len(record), burn_in, guard, cycles, cycle)
    scale = np.array([model.outputs[c].scale for c in columns])
    return Problem(record, columns, adapted, splits, np.ones((len(record), len(columns))), 1e-7 * scale)


def split_names(n: int, burn_in: int, guard: int, cycles: int, cycle: Sequence[str]) -> NDArray[np.str_]:
    """Name of the split of each of n rows (n,); arguments as of `make_problem`."""
    splits = np.full(n, "", dtype="<U8")
    edges = np.linspace(burn_in, n, cycles * len(cycle) + 1).round().astype(int)
    for k, (start, stop) in enumerate(pairwise(edges)):
        split = cycle[k % len(cycle)]
        same = k > 0 and cycle[(k - 1) % len(cycle)] == split
        splits[start + (0 if same or k == 0 else guard) : stop] = split
    return splits
