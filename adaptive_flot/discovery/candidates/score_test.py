"""Efficient scores: how much of the residual each candidate would explain, to first order, for one linearisation.

The efficient score test. With the whitened residual e of a fit (N,), the whitened responses Z (N, q) to what is free
already, and those X (N, r) to one variant of a candidate::

    M = I - Z (Z'Z)^-1 Z'      S = e'M X (X'M X)^-1 X'M e      b = (X'M X)^-1 X'M e

S is the drop of minus two log-likelihood that a fit of the variant would bring, to first order, and chi-squared with r
degrees of freedom where the variant is no part of the plant; b is where a fit of it starts. Rao, *Proc. Cambridge
Philos. Soc.* 44 (1948) 50; with nuisance parameters (M) Neyman's C(alpha), *Probability and Statistics* (1959) 213.

M takes out what adapted parameters and initial state can absorb: that is no evidence. The noise model is that of the
residual after *everything in the catalogue at once* (a ridge fit), so that it is neither blind to coloured noise nor
soaked up by the very effect that is looked for.

Where there is a background (see `record.background`), its u ~ N(0, I) is free as well: Z has the responses to it,
and for each component of u a further row, with 1 in Z, 0 in X, and -u in e. So M takes out what it can absorb,
at the price of its prior.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import cast

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import Candidate
from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.candidates.ridge import ridge
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.noise import Noise, with_rows_before
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import CLIP, noise_by_differences, without_spikes
from adaptive_flot.greybox.model import FloatArray

PRIOR_SHARE = 0.3
"""Prior standard deviation of a change at a site, as a share of its value, in the ridge fit of the noise."""
DEPENDENT = 1e-12
"""Share of the strongest combination of a variant's responses below which one is rounding, in squares."""
AT_ONCE = 100
"""Rows or columns of a catalogue's responses (150 MB) that are worked on in one go: fresh memory is slow."""
EXPLODED = 1e9
"""Responses of so many units of noise are of a run that would not hold, as where a fitted curve feeds itself: none."""
ABSORBED = 1e-7
"""Share of a response that must be left after projection; less is rounding, in which anything can be found."""


@dataclass(frozen=True)
class Score:
    """First-order evidence for one candidate: its best variant.

    Attributes
    ----------
    candidate, variant
        What was scored.
    gain
        The score statistic S: drop of minus two log-likelihood on the estimation rows, to first order.
    penalised
        S - k log(number of measurements), with k coefficients: Schwarz, *Ann. Statist.* 6 (1978) 461.
    start
        Values of the coefficients to start a fit from.
    """

    candidate: Candidate
    variant: Variant
    gain: float
    penalised: float
    start: dict[str, float]


class Scorer:
    """Whitened, projected responses of a whole catalogue along one fit.

    The noise model is worked out as above where none is given.
    """

    def __init__(
        self,
        problem: Problem,
        fit: Fit,
        responses: Responses,
        candidates: list[Candidate],
        noise: Noise | None = None,
    ) -> None:
        self.problem, self.fit, self.candidates = problem, fit, candidates
        self.drivers, self._responses = responses.drivers, responses
        self.rows = problem.rows("estimate")
        self._count = int(np.isfinite(problem.measured[self.rows]).sum())
        self._variants = {c.name: tuple(places) for c, places in _places(candidates)}
        profiles = [profile for c in candidates for v in c.variants for profile in v.profiles]
        self._reached = with_rows_before(self.rows)
        weighted = self._weighted_responses(profiles)
        nuisance = responses.nuisance
        if problem.background is not None:
            nuisance = np.concatenate([nuisance, problem.background.responses], axis=2)
        nuisance = (nuisance / problem.weights[:, :, None])[self._reached]
        residual = without_spikes(fit.residual(problem) / problem.weights)
        self._size = np.array([self._prior(c.offset, responses, c.site) for c in profiles])
        self.noise = noise or self._clean_noise(residual, weighted, nuisance)
        e = self.noise.whiten(residual)
        present = np.isfinite(e) & self.rows[:, None]
        self._present = present[self._reached]
        self._rows_of_background = len(fit.background)
        output = np.nonzero(self._present)[1]
        self._output = np.concatenate([output, np.full(len(fit.background), -1)])  # of each value that is present
        self._base = base = np.linalg.qr(self._with_prior(self._whitened(nuisance)))[0]
        columns = self._whitened(weighted)
        del weighted  # each is 150 MB for a whole catalogue
        columns *= self._size  # from here on in standard deviations of the prior
        size = np.einsum("ij,ij->j", columns, columns)
        along = base.T @ columns
        for part in _parts(len(columns)):
            columns[part] -= base[part] @ along
        left = np.einsum("ij,ij->j", columns, columns)
        columns[:, left < ABSORBED**2 * size] = 0.0  # what is left is rounding
        self.residual = self._project(np.concatenate([np.clip(e[present], -1e3, 1e3), -fit.background]))
        self._columns = columns
        self._along = columns.T @ self.residual
        self._null_gains: dict[tuple[int, int], FloatArray] = {}
        self._grams = {s.start: columns[:, s].T @ columns[:, s] for _, s in self._all_variants()}

    def _all_variants(self) -> Iterator[tuple[Variant, slice]]:
        """Every variant of every candidate, with its columns."""
        return chain.from_iterable(self._variants.values())

    def output_of(self, site: str) -> tuple[int, float] | None:
        """Index of the measured output that shows a site most, and its usual response to it; None where none does."""
        return self._responses.output_of(site)

    def in_mode(self, site: str, mode: str | None, wanted: str | None) -> float:
        """Factor that turns a small change at a site, given in one mode (None: the site's own), into another mode."""
        own = next(s.mode for s in self.fit.model.sites if s.name == site)
        usual = self._responses.usual(site)
        is_offset, as_offset = (mode or own) == "offset", (wanted or own) == "offset"
        return 1.0 if is_offset == as_offset else usual if as_offset else 1 / max(usual, 1e-300)

    def _weighted_responses(self, profiles: list[TimeProfile]) -> FloatArray:
        """Weighted responses to r profiles on the rows of `_reached` (rows, m, r)."""
        weighted = self._responses.of(profiles, self._reached)
        weighted /= self.problem.weights[self._reached][:, :, None]
        for part in _parts(weighted.shape[2]):
            weighted[:, :, part][:, :, ~(np.abs(weighted[:, :, part]).max(axis=(0, 1)) < EXPLODED)] = 0.0
        return weighted

    def _whitened(self, weighted: FloatArray) -> FloatArray:
        """Whitened responses (values present, r) of weighted ones (rows, m, r), a few at a time to save memory.

        Below them stand the rows of the background, where they are zero.
        """
        count = int(self._present.sum())
        white = np.empty((count + self._rows_of_background, weighted.shape[2]))
        white[count:] = 0.0
        for part in _parts(weighted.shape[2]):
            white[:count, part] = self.noise.whiten(weighted[:, :, part])[self._present]
        return white

    def _with_prior(self, white: FloatArray) -> FloatArray:
        """Whitened responses to all that is free, the last ones to the background, with 1 in its rows."""
        k = self._rows_of_background
        if k:
            white[-k:, -k:] = np.eye(k)
        return white

    @staticmethod
    def _prior(offset: bool, responses: Responses, site: str) -> float:
        return PRIOR_SHARE * (responses.usual(site) if offset else 1.0)

    def _project(self, e: FloatArray) -> FloatArray:
        projected: FloatArray = e - self._base @ (self._base.T @ e)
        return projected

    def _clean_noise(self, residual: FloatArray, weighted: FloatArray, nuisance: FloatArray) -> Noise:
        """Noise left by a ridge fit of the constant, the slow and the power-law profiles of all sites together.

        With responses X in standard deviations of their prior, and the residual y, both without what Z explains::

            b = (X'X + I)^-1 X'y,   left = y - X b

        Values of y that stand out (CLIP) do not count.
        """
        wanted: list[int] = []
        for variant, columns in self._all_variants():
            family = variant.effect.family
            if family.is_linear and (variant.effect.driver == "time" or not family.is_curve):
                wanted += range(columns.start, columns.stop)
        std = np.maximum(np.nan_to_num(noise_by_differences(residual)), self.problem.floor)
        r = residual[self.rows] / std
        present = np.isfinite(r)
        inside = self.rows[self._reached]
        X = weighted[np.ix_(inside, np.arange(weighted.shape[1]), np.array(wanted, dtype=np.intp))][present]
        X *= self._size[wanted]
        X /= np.broadcast_to(std, present.shape)[present][:, None]
        Z = (nuisance[inside] / std[:, None])[present]
        y = r[present]
        base, _ = np.linalg.qr(Z)
        X -= base @ (base.T @ X)
        y = y - base @ (base.T @ y)
        keep = np.abs(y) <= max(CLIP * 1.4826 * np.median(np.abs(y)), CLIP)
        left = y - X @ ridge(X[keep], y[keep])
        full = np.full(residual.shape, np.nan)
        table = np.full(r.shape, np.nan)
        table[present] = left
        full[self.rows] = table * std
        return self.problem.noise(full, self.rows)

    @property
    def measurements(self) -> int:
        """Number of measurements on the estimation rows."""
        return self._count

    def energy(self) -> FloatArray:
        """Squared projected residual of each row (N,), summed over the outputs; zero where a row is not estimated."""
        squares = np.zeros(self._present.shape)
        squares[self._present] = self.residual[: int(self._present.sum())] ** 2
        by_row = np.zeros(len(self.rows))
        by_row[self._reached] = squares.sum(axis=1)
        return by_row

    def projected_profiles(self, profiles: list[TimeProfile]) -> FloatArray:
        """Whitened responses M X (values present, r) to r profiles, without what is free already."""
        columns = self._whitened(self._weighted_responses(profiles))
        columns -= self._base @ (self._base.T @ columns)
        return columns

    def projected(self, responses: FloatArray) -> FloatArray:
        """Whitened responses M X (values present, r) of plain ones X (N, m, r), without what is free already.

        Zeros for what can not be simulated beside a change: it explains nothing.
        """
        weighted = (responses / self.problem.weights[:, :, None])[self._reached]
        white = self._whitened(weighted)
        white -= self._base @ (self._base.T @ white)
        return np.where(np.isfinite(white).all(axis=0), white, 0.0)

    def scores(self) -> list[Score]:
        """Scores of all candidates, best first."""
        return _ranked([self.variant_scores(candidate)[0] for candidate in self.candidates])

    def scores_in_output(self, j: int) -> list[Score]:
        """Scores by what a fit of each candidate to all outputs would gain in the j-th alone, best first.

        With the rows X_j of the projected responses, e_j of the residual, b fitted to all outputs, and the penalty of
        `penalised`, the order is that of::

            S_j - k log(number of measurements),   S_j = 2 b'X_j'e_j - b'X_j'X_j b

        Left out is what gains less than its penalty; `gain` and `penalised` stay those over all outputs.
        """
        gained = [(self.gain_in_output(score, j) + score.penalised - score.gain, score) for score in self.scores()]
        return [score for gain, score in sorted(gained, key=lambda g: -g[0]) if gain > 0]

    def gain_in_output(self, score: Score, j: int) -> float:
        """S_j of a score (see `scores_in_output`); over all outputs they add up to its gain."""
        columns = next(p for v, p in self._variants[score.candidate.name] if v is score.variant)
        own = self._output == j
        explained = self._columns[own, columns] @ self._fitted(columns)
        return float(explained @ (2 * self.residual[own] - explained))

    def _fitted(self, columns: slice) -> FloatArray:
        """Coefficients b of a variant, in standard deviations of the prior."""
        A = self._grams[columns.start]
        ridge = (1e-9 * np.trace(A) / len(A) + 1e-30) * np.eye(len(A))
        return cast(FloatArray, np.linalg.solve(A + ridge, self._along[columns]))

    def variant_scores(self, candidate: Candidate) -> list[Score]:
        """Scores of all variants of one candidate, best first."""
        return _ranked([self._score(candidate, v, columns) for v, columns in self._variants[candidate.name]])

    def _score(self, candidate: Candidate, variant: Variant, columns: slice) -> Score:
        beta = self._fitted(columns)
        gain = float(self._along[columns] @ beta)
        shapes = len(variant.start)
        penalty = (len(variant.profiles) + shapes) * float(np.log(self._count))
        values = beta * self._size[columns]
        start = {n: float(v) for n, v in zip(variant.coefficients, values, strict=True) if n}
        return Score(candidate, variant, gain, gain - penalty, {**start, **dict(variant.start)})

    def null_gains(self, draws: int, seed: int) -> FloatArray:
        """Largest penalised score (draws,) of the catalogue on white noise: the null law of the search.

        Parametric bootstrap of the maximum over all variants v, with e ~ N(0, I) in place of the whitened residual::

            max over v of e'M X_v (X_v'M X_v)^-1 X_v'M e - k_v log(number of measurements)

        Davison & Hinkley, *Bootstrap Methods and their Application* (1997), 4.2; the maximum because the best of many
        is reported (Westfall & Young, *Resampling-Based Multiple Testing*, 1993). Drawn once: a search asks again.
        """
        if (draws, seed) not in self._null_gains:
            self._null_gains[draws, seed] = self._drawn_null_gains(draws, seed)
        return self._null_gains[draws, seed]

    def _drawn_null_gains(self, draws: int, seed: int) -> FloatArray:
        rng = np.random.default_rng(seed)
        along = self._columns.T @ rng.standard_normal((len(self._columns), draws))
        best = np.full(draws, -np.inf)
        for variant, columns in self._all_variants():
            strength, turned = np.linalg.eigh(self._grams[columns.start])
            good = strength > max(DEPENDENT * strength[-1], 1e-60)
            gain = np.sum((turned[:, good].T @ along[columns]) ** 2 / strength[good, None], axis=0)
            penalty = (len(variant.profiles) + len(variant.start)) * np.log(self._count)
            best = np.maximum(best, gain - penalty)
        return best


def _places(candidates: Sequence[Candidate]) -> Iterator[tuple[Candidate, list[tuple[Variant, slice]]]]:
    """Each candidate with its variants, and the columns of each in the table of all responses."""
    first = 0
    for candidate in candidates:
        places = []
        for variant in candidate.variants:
            places.append((variant, slice(first, first + len(variant.profiles))))
            first += len(variant.profiles)
        yield candidate, places


def _ranked(scores: list[Score]) -> list[Score]:
    return sorted(scores, key=lambda s: -s.penalised)


def _parts(count: int) -> Iterator[slice]:
    """Slices of a range, each of at most `AT_ONCE`."""
    return (slice(first, min(first + AT_ONCE, count)) for first in range(0, count, AT_ONCE))
