"""A pulse in time: a change that comes, lasts for a while and goes again, as a hose left open or a valve that sticks.

Neither a curve with knots far apart nor a step finds one that is short against the record. So each pair of edges is
tried. To first order the response to a pulse is that to a step at its beginning, less that to one at its end. With
projected whitened responses X (values, k) to steps at k times, and the residual e::

    a = X'e,   G = X'X,   gain(i, j) = (a_j - a_i)^2 / (G_ii - 2 G_ij + G_jj)

is the score statistic of the pulse from time i to time j, and (a_i - a_j) over the same its amplitude: Rao,
*Proc. Cambridge Philos. Soc.* 44 (1948) 50. An edge that is a few rows off may explain nothing, as what answers at once
does so for a few rows only. So the times tried are even ones, and those just before the residual stands out; then each
row around the best two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.candidates.catalogue import Candidate
from adaptive_flot.discovery.candidates.responses import TimeProfile
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

PULSE = "switch"
"""The form of a pulse."""
EDGES, PEAKS, BEFORE = 97, 20, 4
"""Even times of an edge that are tried, places where the residual stands out, and rows before each."""
AROUND = 10
"""Rows around each of the best two edges that are tried in the end."""
EDGE_ROWS = 1.5
"""Rows over which an edge is rounded: a fit has to see which way to move it."""
PARAMETERS = 3
"""Amplitude, beginning and length."""


def with_pulses(scorer: Scorer, scores: Sequence[Score]) -> list[Score]:
    """The scores, best first, with a pulse for each site whose change in time scores better as one.

    Parameters
    ----------
    scorer
        Responses and residual along a fit.
    scores
        Scores of its candidates.
    """
    found, at = [], _times(scorer)
    for score in scores:
        if score.candidate.driver == "time":
            pulse = _pulse(scorer, score, at)
            found.append(pulse if pulse.penalised > score.penalised else score)
        else:
            found.append(score)
    return sorted(found, key=lambda s: -s.penalised)


def _pulse(scorer: Scorer, score: Score, at: FloatArray) -> Score:
    """The best pulse at the site of a score, with edges among some times (k,) and then around these."""
    time = scorer.problem.record.time
    i, j, _, _ = _best_pair(scorer, score.candidate, at)
    reach = np.arange(-AROUND, AROUND + 1) * float(time[1] - time[0])
    finer = np.unique(np.concatenate([at[i] + reach, at[j] + reach]))
    finer = finer[(finer > time[0]) & (finer <= time[-1])]
    i, j, gain, amplitude = _best_pair(scorer, score.candidate, finer)
    start = {"amplitude": amplitude, "on_1": float(finer[i]), "for_1": float(finer[j] - finer[i])}
    penalised = gain - PARAMETERS * float(np.log(scorer.measurements))
    return replace(score, variant=_variant(score.candidate, time, start), gain=gain, penalised=penalised, start=start)


def _times(scorer: Scorer) -> FloatArray:
    """Times of an edge that are tried (k,): even ones, and rows just before the residual stands out."""
    time, left = scorer.problem.record.time, scorer.energy()
    rows: list[int] = []
    for _ in range(PEAKS):
        peak = int(np.argmax(left))
        if not left[peak] > 0:
            break
        rows += range(max(peak - BEFORE, 1), peak + 1)
        left[max(peak - BEFORE, 0) : peak + BEFORE + 1] = 0.0
    return np.unique(np.concatenate([np.linspace(time[0], time[-1], EDGES)[1:], time[rows]]))


def _best_pair(scorer: Scorer, candidate: Candidate, at: FloatArray) -> tuple[int, int, float, float]:
    """Places of the best two edges among some times (k,), the gain of the pulse between them, and its amplitude."""
    time, site = scorer.problem.record.time, candidate.site
    steps = [TimeProfile(site.name, (time >= t).astype(float), site.mode == "offset") for t in at]
    X = scorer.projected_profiles(steps)
    along, gram = X.T @ scorer.residual, X.T @ X
    size = np.diag(gram)[:, None] + np.diag(gram)[None, :] - 2 * gram
    first, last = np.triu_indices(len(at), k=1)
    strength = size[first, last]
    difference = along[first] - along[last]
    sure = strength > 1e-9 * np.max(size, initial=1e-300)
    gains = np.where(sure, difference**2 / np.where(sure, strength, 1.0), 0.0)
    best = int(np.argmax(gains))
    amplitude = float(difference[best] / max(strength[best], 1e-300))
    return int(first[best]), int(last[best]), float(gains[best]), amplitude


def _variant(candidate: Candidate, time: FloatArray, start: dict[str, float]) -> Variant:
    site, begin, length = candidate.site, start["on_1"], start["for_1"]
    inside = ((time >= begin) & (time < begin + length)).astype(float)
    settings = {"count": 1.0, "width": EDGE_ROWS * float(time[1] - time[0])}
    effect = Effect(site.name, "time", PULSE, settings=settings)
    profile = TimeProfile(site.name, inside, site.mode == "offset")
    return Variant(effect, (profile,), ("amplitude",), (("on_1", begin), ("for_1", length)))
