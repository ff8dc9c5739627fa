"""From tested hypotheses to a word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import chi2

from adaptive_flot.discovery.hypotheses.comparison import (
    EXPLAINED,
    LEAST_DIFFERENCE,
    Blocks,
    blocks_of,
    stands,
    tied,
)
from adaptive_flot.discovery.hypotheses.cross_validation import Tested
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.hypotheses.plausible import at_edge
from adaptive_flot.discovery.results.words import LARGEST_CLASS, NORMAL95
from adaptive_flot.greybox.model import FloatArray

Word = Literal["none", "named", "class", "abstain", "insufficient"]
CHANCE = 0.95
"""Quantile of what chance does."""
DRAWS = 999
FEWEST_ROWS = 60
"""Rows that the new records, and the reference, must have."""


@dataclass(frozen=True)
class WithoutSite:
    """What acts where the model has no site: the name of the place, what it depends on, and words."""

    place: str
    driver: str
    words: str


USUAL = "its errors are those of the reference"


@dataclass(frozen=True)
class UsualLoss:
    """What the model costs on its reference.

    Attributes
    ----------
    losses
        Mean loss of a row in each block of the reference records (b,).
    constants
        Number of constants that have a prior.
    rows
        Rows of the reference that count.
    errors
        Root mean square error of each measured output (m,).
    """

    losses: FloatArray
    constants: int
    rows: int
    errors: FloatArray

    def exceeded(self, tested: Tested, count: int, blocks: int) -> str | None:
        """What is larger on new rows than it would be by chance, in words; None where nothing is.

        Chance: means of as many blocks, drawn from the reference (bootstrap), and constants that differ by what the
        reference leaves open (chi-squared). Where a record starts, the reference does not say.
        """
        draws = np.random.default_rng(0).choice(self.losses, (DRAWS, max(blocks, 1))).mean(axis=1)
        if (tested.total - tested.prior) / count > float(np.quantile(draws, CHANCE)):
            return "its errors are larger than on the reference"
        if tested.moved(self.constants) > float(chi2.ppf(CHANCE, max(self.constants, 1))):
            return "it needs constants that the reference excludes"
        return None


@dataclass(frozen=True)
class Judged:
    """What the tested hypotheses amount to.

    Attributes
    ----------
    word
        `none`, `named`, `class`, `abstain` or `insufficient`.
    best
        The best hypothesis that stands; None where none does.
    alike
        Those that the records do not tell from it, of the same part and of others, best first.
    why
        What decided, in words, where the word is `none`, `abstain` or `insufficient`.
    explained
        Share of what is above the usual level that the best one removes; NaN where there is none.
    beside
        What explains about as much as a name where the model has no site; None where nothing does.
    """

    word: Word
    best: Tested | None
    alike: tuple[Tested, ...]
    why: str
    explained: float
    beside: WithoutSite | None = None

    @property
    def parts(self) -> tuple[Tested, ...]:
        """The hypothesis of each site that is not told apart and puts it best, the best site first: see `_costs`."""
        sites: dict[str, list[Tested]] = {}
        for t in filter(None, (self.best, *self.alike)):
            sites.setdefault(_site(t), []).append(t)
        return tuple(map(_first, sites.values()))


def _costs(tested: Tested) -> float:
    """The criterion on rows that did not fit it, and LEAST_DIFFERENCE for each coefficient.

    Of two hypotheses at a site the simpler one is told, unless the other one is better by more: a tacho that shows 6 %
    less was told as one that shows 0.3 rad/s less, and left more than the reference.
    """
    return tested.total + LEAST_DIFFERENCE * len(tested.fit.coefficients)


def _first(same: Sequence[Tested]) -> Tested:
    """Of hypotheses at one site the one that is told: the best one, or an offset where an error of the span is idle."""
    found = min(same, key=_costs)
    offset = (t for t in same if t.hypothesis is not None and t.hypothesis.kind == "offset")
    return next(offset, found) if has_idle_span(found) else found


def has_idle_span(tested: Tested) -> bool:
    """Whether an error of a span has a slope of less than its uncertainty, so that it is an offset.

    An analyser that showed 0.024 too much was told as one with "a span 0 % smaller".
    """
    h = tested.hypothesis
    if h is None or h.kind != "span":
        return False
    value = dict(zip(h.free, map(tested.fit.value, h.parameters), strict=True))
    spread = dict(zip(h.free, tested.spread, strict=True))
    return bool(abs(value["slope"]) <= NORMAL95 * spread["slope"])


def _offset_of_idle_span(best: Tested, alike: Sequence[Tested], ranked: Sequence[Tested]) -> tuple[Tested, ...]:
    """The offset at the site of a best hypothesis whose span is idle, where it is not among those alike; else nothing.

    With a slope of zero both are the same, so that only their fits differ: an offset that rests a little beside.
    """
    there = (t for t in ranked if t.hypothesis is not None and t.hypothesis.kind == "offset")
    same = [t for t in there if _site(t) == _site(best) and not any(t is a for a in alike)]
    return tuple(same[:1]) if has_idle_span(best) else ()


def _simplest(best: Tested, alike: tuple[Tested, ...]) -> tuple[Tested, tuple[Tested, ...]]:
    """Of what is not told apart, the hypothesis at the best one's site that is told comes first; see `_first`."""
    same = [best, *(t for t in alike if _site(t) == _site(best))]
    first = _first(same)
    offset = first.hypothesis is not None and first.hypothesis.kind == "offset"
    others = (t for t in (best, *alike) if t is not first)
    return first, tuple(t for t in others if not (offset and t in same and has_idle_span(t)))


def _site(tested: Tested) -> str:
    return tested.hypothesis.site if tested.hypothesis else ""


def judge(
    rows: Rows,
    null: Tested,
    tested: Sequence[Tested],
    usual: UsualLoss | None,
    excluded: bool = False,
) -> tuple[Judged, Blocks]:
    """Judge.

    Parameters
    ----------
    rows
        Records and rows.
    null
        The model as it is.
    tested
        The hypotheses.
    usual
        Losses of the reference; None where there is none.
    excluded
        Whether the reference excludes the constants with which the model as it is fits, though its covariance does not.

    Returns
    -------
    tuple
        The judgement, and the blocks that it was made on.
    """
    blocks = blocks_of(rows, null.fresh)
    count = rows.count
    if min(count, usual.rows if usual is not None else count) < FEWEST_ROWS:
        short = f"{count} rows count" + (f", and {usual.rows} of the reference" if usual is not None else "")
        why = f"{short}; {FEWEST_ROWS} of each are needed"
        return Judged("insufficient", None, (), why, float("nan")), blocks
    level = null.total / count
    least = float(np.mean(usual.losses)) if usual is not None else float(len(rows.columns) / np.mean(rows.memory))
    if usual is not None:
        if usual.exceeded(null, count, len(blocks.edges)) is None and not excluded:
            return Judged("none", None, (), USUAL, float("nan")), blocks
    ranked = sorted((t for t in tested if np.isfinite(t.total)), key=lambda t: t.total)
    errors = None if usual is None else usual.errors
    standing = [t for t in ranked if stands(rows, blocks, null, t, errors)]
    if not standing:
        why = "no single hypothesis makes the errors smaller on rows that did not fit it"
        return Judged("abstain", None, tuple(ranked[:3]), why, float("nan")), blocks
    inside = [t for t in standing if not at_edge(t)]
    if not inside:
        why = "what fits best would have to be larger than such a fault can be, so that something else is the matter"
        return Judged("abstain", None, tuple(standing[:3]), why, float("nan")), blocks
    best = inside[0]
    beyond = [t for t in standing if t.total < best.total]  # at an edge: no explanation, but as good a fit
    excess = max(level - least, 1e-12)
    explained = float((level - best.total / count) / excess)
    adequate = usual is not None and usual.exceeded(best, count, len(blocks.edges)) is None
    alike = (*beyond, *tied(blocks, null, best, [t for t in ranked if t is not best and t not in beyond], adequate))
    beaten = ranked[0] is not best and not any(t is ranked[0] for t in alike)
    best, alike = _simplest(best, (*alike, *_offset_of_idle_span(best, alike, ranked)))
    judged = Judged("named", best, alike, "", explained)
    if beaten:
        why = "what fits best makes an output worse, so that something else is the matter"
        return Judged("abstain", best, alike, why, explained), blocks
    if explained < EXPLAINED:
        why = f"the best one removes {100 * explained:.0f} % of what is unusual, so that something else is the matter"
        return Judged("abstain", best, alike, why, explained), blocks
    parts = len(judged.parts)
    if parts > LARGEST_CLASS:
        return Judged("abstain", best, alike, f"{parts} parts explain it about as well", explained), blocks
    return Judged("named" if parts == 1 else "class", best, alike, "", explained), blocks
