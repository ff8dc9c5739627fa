"""Which effects of the best explanation are certain, and whether they predict rows that did not fit them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import bootstrap

from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations.refit import Refitter
from adaptive_flot.discovery.innovations.search import LEAST_GAIN, Explanation, Search
from adaptive_flot.greybox.model import FloatArray

NEAR = 0.05
"""Where process noise outweighs the measurement noise, something else is wrong with the model. An explanation whose
gain is smaller by less than this share of it is then not told apart."""
ADEQUATE = 1.5
"""Standard deviation of an innovation, in those of the measurement noise, up to which nothing else is wrong."""
SMALL = 0.15
"""An effect beside another one, that brings less than this share of the gain, is not told."""
FOLDS = 5
BLOCK = 12
"""Rows of a block of the bootstrap: innovations hardly remember."""
DRAWS = 999
LARGEST_CLASS = 3
"""Sites that a class may hold at most."""

Word = Literal["none", "named", "class", "abstain"]


@dataclass(frozen=True)
class Told:
    """What the innovations form says.

    Attributes
    ----------
    word
        `none`, `named`, `class` or `abstain`.
    best
        The best explanation; of a name, with what is certain and nothing else.
    certain
        Its effects that every explanation about as good has, too.
    open
        Effects of a class, one a site, the best one's first.
    alike
        Explanations that the record does not tell from the best one, this one first.
    why
        What decided, in words, where nothing is told.
    """

    word: Word
    best: Explanation
    certain: tuple[Hypothesis, ...]
    open: tuple[tuple[Explanation, Hypothesis], ...]
    alike: tuple[Explanation, ...]
    why: str

    @property
    def sites(self) -> frozenset[str]:
        """Sites of every effect of the explanations that are not told apart."""
        return frozenset(h.site for e in self.alike for h in e.hypotheses)


def judge(search: Search, base: Explanation, found: Sequence[Explanation]) -> Told:
    """Judge the explanations, the best first.

    What is certain must be in every explanation about as good, and must predict stretches of rows that did not fit its
    coefficients better than the rest of the explanation does without it. Where the rest is one of a few, it is a class.
    """
    best = found[0]
    if best.criterion - base.criterion < LEAST_GAIN:
        return Told("none", base, (), (), (base,), "constants and process noise explain it")
    alike = (best, *(e for e in found[1:] if not told_apart(search, base, best, e)))
    certain = tuple(h for h in best.hypotheses if all(_has(e, h) for e in alike))
    failed = _contradicted(search, best, best.hypotheses)
    if failed and len(best.hypotheses) > 1:  # the one that does least is given up, and the rest judged anew
        others = [e for e in found if not _has(e, failed[0])]
        return judge(search, base, others)
    if failed:
        said = ", ".join(h.label for h in failed)
        return Told("abstain", best, (), (), alike, f"{said} predicts no rows that did not fit it")
    rest = [(e, h) for e in alike for h in e.hypotheses if not any(_same(h, c) for c in certain)]
    events = [(e, h) for e, h in rest if h.kind == "switch"]
    if {id(e) for e, _ in events} == {id(e) for e in alike}:  # whatever else there is, something is switched
        members = _one_a_site(events)
        if 2 <= len(members) <= LARGEST_CLASS:
            return Told("class", best, certain, members, alike, "")
    members = _one_a_site(rest)
    if len(certain) == len(best.hypotheses):
        return _without_small_ones(search, base, Told("named", best, certain, (), alike, ""))
    if 2 <= len(members) <= LARGEST_CLASS and all(len(e.hypotheses) == len(best.hypotheses) for e in alike):
        return Told("class", best, certain, members, alike, "")
    if not certain:
        why = f"{len(alike)} explanations are about as good, and have no effect in common"
        return Told("abstain", best, (), (), alike, why)
    kept = best
    for h in best.hypotheses:
        if h not in certain:
            kept = search.without(kept, next(k for k in kept.hypotheses if k is h))
    return Told("named", kept, certain, (), alike, "")


def _without_small_ones(search: Search, base: Explanation, told: Told) -> Told:
    """A name without effects that do little beside another one: these take up what else is wrong with the model."""
    best, total = told.best, told.best.criterion - base.criterion
    for h in told.certain:
        without = search.without(best, h) if len(best.hypotheses) > 1 else base
        if best.criterion - without.criterion < SMALL * total:
            kept = tuple(k for k in told.certain if k is not h)
            return _without_small_ones(search, base, replace(told, best=without, certain=kept))
    return told


def _one_a_site(pairs: Sequence[tuple[Explanation, Hypothesis]]) -> tuple[tuple[Explanation, Hypothesis], ...]:
    by_site: dict[str, tuple[Explanation, Hypothesis]] = {}
    for e, h in pairs:
        by_site.setdefault(h.site, (e, h))
    return tuple(by_site.values())


def told_apart(search: Search, base: Explanation, best: Explanation, other: Explanation) -> bool:
    """Whether the record tells an explanation from a better one: by enough, and in more than a few rows."""
    lead, least = best.criterion - other.criterion, LEAST_GAIN / 2
    if not _adequate(search, best):
        least = max(least, NEAR * (best.criterion - base.criterion))
    return lead >= least and low_end(best.fit.rows - other.fit.rows, best.numbers - other.numbers) > 0


def _adequate(search: Search, explanation: Explanation) -> bool:
    """Whether measurement noise is about all that an explanation leaves."""
    fit = explanation.fit
    r = fit.noise.std(search.model)[list(search.columns)]
    return float(np.max(np.nanmedian(np.sqrt(fit.filtered.variance), axis=0) / r)) <= ADEQUATE


def low_end(gain: FloatArray, numbers: int = 0) -> float:
    """Lower end of the 95 % interval of a sum over rows (N,) by the block bootstrap, less k / 2 log n for k numbers."""
    counted = gain[gain != 0]
    blocks = np.array([b.sum() for b in np.array_split(gain, max(len(gain) // BLOCK, 4))])
    charge = numbers / 2 * float(np.log(max(len(counted), 2))) / len(blocks)
    if not blocks.std() > 0:
        return float((blocks - charge).sum())
    found = bootstrap((blocks - charge,), np.sum, n_resamples=DRAWS, method="percentile", rng=0, vectorized=True)
    return float(found.confidence_interval.low)


def _has(explanation: Explanation, h: Hypothesis) -> bool:
    """Whether an explanation has an effect at the same site: an event where it is one, a lasting one else."""
    return any(_same(k, h) for k in explanation.hypotheses)


def _same(a: Hypothesis, b: Hypothesis) -> bool:
    return a.site == b.site and (a.driver == "time") == (b.driver == "time")


def _contradicted(search: Search, explanation: Explanation, asked: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Effects without which the other ones predict fresh rows as well, the one that gains least first."""
    fresh = _fresh_rows(search, explanation)
    failed: list[tuple[float, Hypothesis]] = []
    for h in asked:
        without = search.without(explanation, h)
        extra = explanation.numbers - without.numbers - len(h.free)
        if low_end(fresh - _fresh_rows(search, without), extra) <= 0:
            failed.append((explanation.criterion - without.criterion, h))
    return tuple(h for _, h in sorted(failed, key=lambda f: f[0]))


def _fresh_rows(search: Search, explanation: Explanation) -> FloatArray:
    """Log-likelihood of each row (N,) by coefficients that were fitted to the other stretches.

    Constants and noise stay as all rows have them: every explanation has the same freedom there. What is asked is
    whether coefficients found on some rows hold on others.
    """
    if not explanation.free:
        return explanation.fit.rows
    n, model = len(search.record), search.model_of(explanation)
    edges = np.linspace(0, n, FOLDS + 1).round().astype(int)

    def one(k: int) -> FloatArray:
        counted = np.ones(n, dtype=bool)
        counted[edges[k] : edges[k + 1]] = False
        fitter = Refitter(model, search.record, search.columns, search.floor, explanation.free, None, counted)
        fit = fitter.fit(explanation.fit.p, explanation.fit.size, hold_noise=True)
        return fit.rows[edges[k] : edges[k + 1]]

    return np.concatenate(parallel_map(one, range(FOLDS), search.processes, _nothing))


def _nothing() -> None:
    """No progress to tell."""
