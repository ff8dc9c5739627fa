"""Which hypotheses stand on rows that did not fit them, and which of them the records can not tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import bootstrap

from adaptive_flot.discovery.hypotheses.cross_validation import Tested
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.record.effective_samples import correlation_times
from adaptive_flot.greybox.model import FloatArray

SHORTEST_BLOCK = 10
FEWEST_BLOCKS = 8
DRAWS = 999
CONFIDENCE = 0.95
TIE = 0.15
"""A rival whose gain is smaller than the best one's by less than this share of it is not told apart from it."""
LEAST_DIFFERENCE = 6.0
"""A rival whose fit costs less than this more is not told apart: twice a difference of log-likelihoods of 3."""
SUBSTANCE = 0.2
"""The error of some output must fall by this share."""
EXPLAINED = 0.5
"""Share of what is above the usual level of the errors that must go; else something else is the matter."""
WORSE, MUCH_WORSE = 0.02, 0.1
"""Shares by which the error of an output may grow: surely, and at all."""
FEW_VALUES = 10.0
"""Independent values of an error below which its size on one record says little of that on another."""
FAR = 3.0
"""Errors count up to so many of their usual sizes where their memory is looked at."""
AT_USUAL = 1.25
"""An error of at most so many times that of the reference is usual: it contradicts nothing, whatever it was before."""


@dataclass(frozen=True)
class Interval:
    """A mean over blocks of rows with its 95 % interval by the block bootstrap."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Blocks:
    """Contiguous blocks of rows of all records, longer than the errors remember."""

    edges: tuple[tuple[int, int, int], ...]
    """(record, first row, row after the last) of each block."""

    def sums(self, losses: Sequence[FloatArray]) -> FloatArray:
        """Sum of a loss (N,) or of each column (N, m) over each block: (blocks,) or (blocks, m)."""
        return np.array([losses[i][a:b].sum(axis=0) for i, a, b in self.edges])


def blocks_of(rows: Rows, errors: Sequence[FloatArray]) -> Blocks:
    """Blocks of twice the time after which the autocorrelation of the errors has fallen below 1 / e.

    Kunsch, *Annals of Statistics* 17 (1989) 1217: a bootstrap of blocks keeps the dependence inside them.
    """
    length = SHORTEST_BLOCK
    for e, counted in zip(errors, rows.counted, strict=True):
        for column in np.where(counted[:, None], e, np.nan).T:
            length = max(length, 2 * _memory(column))
    total = sum(len(r) for r in rows.records)
    length = max(SHORTEST_BLOCK, min(length, total // FEWEST_BLOCKS))
    edges: list[tuple[int, int, int]] = []
    for i, counted in enumerate(rows.counted):
        there = np.flatnonzero(counted)
        if not len(there):
            continue
        first, last = int(there[0]), int(there[-1]) + 1
        count = max(1, round((last - first) / length))
        cuts = np.linspace(first, last, count + 1).round().astype(int)
        edges += [(i, int(a), int(b)) for a, b in pairwise(cuts)]
    return Blocks(tuple(edges))


def _memory(errors: FloatArray) -> int:
    """Rows after which the autocorrelation falls below 1 / e."""
    e = errors[np.isfinite(errors)]
    if len(e) < 2 * SHORTEST_BLOCK or not e.std() > 0:
        return 0
    e = e - e.mean()
    spectrum = np.fft.rfft(e, 2 * len(e))
    acf = np.fft.irfft(spectrum * spectrum.conj())[: len(e) // 2]
    below = np.flatnonzero(acf / acf[0] < np.exp(-1))
    return int(below[0]) if below.size else len(e) // 2


def mean_difference(blocks: Blocks, old: Tested, new: Tested) -> Interval:
    """Mean over blocks of the criterion of one less that of another, with its interval (percentile bootstrap)."""
    each = blocks.sums([loss.sum(axis=1) for loss in old.losses])
    each = each - blocks.sums([loss.sum(axis=1) for loss in new.losses]) + (old.prior - new.prior) / len(each)
    if len(each) < 3 or not each.std() > 0:
        value = float(each.mean()) if len(each) else 0.0
        return Interval(value, min(value, 0.0), max(value, 0.0))
    found = bootstrap(
        (each,), np.mean, n_resamples=DRAWS, confidence_level=CONFIDENCE, method="percentile", rng=0
    ).confidence_interval
    return Interval(float(each.mean()), float(found.low), float(found.high))


def rms(rows: Rows, errors: Sequence[FloatArray]) -> FloatArray:
    """Root mean square error of each output over the rows that count (m,)."""
    together = np.concatenate([e[c] for e, c in zip(errors, rows.counted, strict=True)])
    with np.errstate(all="ignore"):
        found: FloatArray = np.sqrt(np.nanmean(together**2, axis=0))
    return found


def reduction(blocks: Blocks, column: int, old: Sequence[FloatArray], new: Sequence[FloatArray]) -> Interval:
    """1 - RMS(new) / RMS(old) of one output, with its 95 % interval by the paired block bootstrap."""
    a, b = (blocks.sums([np.nan_to_num(e[:, column] ** 2) for e in errors]) for errors in (old, new))
    if len(a) < 3 or not a.sum() > 0:
        return Interval(0.0, float("-inf"), float("inf"))

    def statistic(x: FloatArray, y: FloatArray, axis: int = -1) -> FloatArray:
        value: FloatArray = 1 - np.sqrt(np.sum(y, axis=axis) / np.maximum(np.sum(x, axis=axis), 1e-300))
        return value

    found = bootstrap(
        (a, b), statistic, paired=True, vectorized=True, n_resamples=DRAWS, method="percentile", rng=0
    ).confidence_interval
    return Interval(float(statistic(a, b)), float(found.low), float(found.high))


def worse_outputs(
    rows: Rows, blocks: Blocks, null: Tested, tested: Tested, usual: FloatArray | None = None
) -> tuple[int, ...]:
    """Outputs whose error grows on rows that did not fit it, surely or by much: positions among the measured ones.

    Not those whose error stays what is `usual` on the reference (m,): without the effect, the constants had moved to
    where these fit a little better, at the cost of what is the matter.
    """
    before, after = rms(rows, null.fresh), rms(rows, tested.fresh)
    return tuple(
        j
        for j in range(len(before))
        if (usual is None or not after[j] <= AT_USUAL * usual[j])
        and (
            after[j] > (1 + MUCH_WORSE) * before[j]
            or (after[j] > (1 + WORSE) * before[j] and reduction(blocks, j, null.fresh, tested.fresh).high < 0)
        )
    )


def stands(rows: Rows, blocks: Blocks, null: Tested, tested: Tested, usual: FloatArray | None = None) -> bool:
    """Whether a hypothesis gains surely, with substance, and makes no output worse; see `worse_outputs` for `usual`.

    Nor may it rest on few values of an error alone, see `rests_on_few_values`.
    """
    before, after = rms(rows, null.fresh), rms(rows, tested.fresh)
    substance = bool(np.nanmax(1 - after / np.maximum(before, 1e-300)) >= SUBSTANCE)
    gain = mean_difference(blocks, null, tested)
    stood = gain.low > 0 and substance and not worse_outputs(rows, blocks, null, tested, usual)
    return stood and not rests_on_few_values(rows, blocks, null, tested)


def rests_on_few_values(rows: Rows, blocks: Blocks, null: Tested, tested: Tested) -> bool:
    """Whether all that gets better is one long wander or two, while an output that says much more gets surely worse.

    An output that integrates what comes in, such as the speed of a machine or a level, drifts by what the model lacks
    anyhow. One record has few independent values of such an error: its rows over their correlation time.
    """
    times = [correlation_times(np.clip(rows.scaled(i, e), -FAR, FAR)) for i, e in enumerate(null.fresh)]
    values = np.sum([c.sum() / np.maximum(t, 1.0) for c, t in zip(rows.counted, times, strict=True)], axis=0)
    moved = [reduction(blocks, j, null.fresh, tested.fresh) for j in range(len(rows.columns))]
    better = [n for n, share in zip(values, moved, strict=True) if share.low > 0]
    worse = [n for n, share in zip(values, moved, strict=True) if share.high < 0]
    return bool(better and worse and max(better) < FEW_VALUES <= max(worse))


def tied(blocks: Blocks, null: Tested, best: Tested, others: Sequence[Tested], adequate: bool) -> tuple[Tested, ...]:
    """Those of `others` that the records do not tell from the best one.

    Parameters
    ----------
    blocks
        Blocks of rows.
    null, best
        The model as it is, and the best hypothesis.
    others
        Its rivals.
    adequate
        Whether the best one leaves no more than what is usual. Where it leaves more, something else is wrong with the
        model, and a small difference between two hypotheses says nothing: rivals within TIE of its gain are as good.
    """
    gain, fitted = null.total - best.total, null.fit.cost - best.fit.cost
    alike = []
    for other in others:
        uncertain = mean_difference(blocks, other, best).low <= 0
        near = other.total - best.total < TIE * gain or other.fit.cost - best.fit.cost < TIE * fitted
        if uncertain or (near and not adequate) or other.fit.cost - best.fit.cost < LEAST_DIFFERENCE:
            alike.append(other)
    return tuple(alike)
