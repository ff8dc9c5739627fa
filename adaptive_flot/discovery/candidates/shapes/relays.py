"""A switch with two thresholds of a signal: on above the upper one, off below the lower one, as it was between.

No curve over a signal draws one, since the same value of the signal goes with both levels. So each pair of some
thresholds is tried. With the projected whitened responses x (values,) to the course of the switch along the fitted run,
and the residual e::

    gain = (x'e)^2 / (x'x)

is the score statistic of the pair, and x'e over x'x its amplitude: Rao, *Proc. Cambridge Philos. Soc.* 44 (1948) 50.
With a level of its own while it is off, x and e are what the response to a constant leaves of them; that gains as well.
The thresholds are even ones over what the signal covers; then closer ones around the best two. A switch that moves once
or twice is left out: a step or a pulse in time would be the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from adaptive_flot.discovery.candidates.dynamics import FOLLOWS
from adaptive_flot.discovery.candidates.responses import TimeProfile
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.candidates.variant import Variant
from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.effects import STATELESS_DRIVERS, Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper

RELAY, TWO_LEVELS = "relay", "two_levels"
"""The forms of a switch with two thresholds: off it does nothing, or something else."""
MOST = 24
"""Dependences, best first, that are tried as a switch."""
THRESHOLDS, BETWEEN = 9, 5
"""Even thresholds that are tried, and closer ones around each of the best two."""
COVERED = (0.02, 0.98)
"""Quantiles of a signal between which thresholds are tried."""
LEAST_MOVES = 3
"""Least times that a switch goes on or off: fewer are a step or a pulse."""
PARAMETERS = 3
"""A level and two thresholds; one more where it moves slowly, and one where it has two levels."""
LAGS = (4.0, 12.0, 36.0)
"""Rows in which a switch moves that are tried beside FOLLOWS: what opens may take its time."""

Thresholds = tuple[float, float]
"""Where a switch goes on, and where off."""


def course(driver: FloatArray, on_above: float, off_below: float) -> BoolArray:
    """Whether a switch is on (N,) along a driver (N,); from the start as the nearer threshold says."""
    told = (driver > on_above) | (driver < off_below)
    told[0] = True
    last = np.maximum.accumulate(np.where(told, np.arange(len(driver)), 0))
    is_on: BoolArray = driver[last] > 0.5 * (on_above + off_below)
    return is_on


def with_relays(scorer: Scorer, scores: Sequence[Score]) -> list[Score]:
    """The scores, best first, with a switch for each of the best dependences that scores better as one.

    Parameters
    ----------
    scorer
        Responses and residual along a fit.
    scores
        Scores of its candidates, best first.
    """
    wanted = [s for s in scores if s.candidate.driver not in STATELESS_DRIVERS][:MOST]
    found = {s.candidate.name: _relay(scorer, s) for s in wanted}
    better = [max(found.get(s.candidate.name) or s, s, key=lambda each: each.penalised) for s in scores]
    return sorted(better, key=lambda s: -s.penalised)


def moves_often(problem: Problem, fit: Fit, effect: Effect) -> bool:
    """Whether a switch of a fit moves often enough along its own run, where the effect is one; True of all others.

    A fit may move a threshold to where the switch goes on once: that is a step in time by another name.
    """
    if effect.form not in (RELAY, TWO_LEVELS):
        return True
    record, model = problem.record, fit.model
    run = Stepper(model, record.dt).simulate(
        fit.initial_state, record.inputs[1:], parameters_of(fit), float(record.time[0])
    )
    is_on = run.states[:, model.names("states").index(f"{effect.label}.on")] > 0.5
    return bool(np.count_nonzero(is_on[1:] != is_on[:-1]) >= LEAST_MOVES)


@dataclass(frozen=True)
class _Found:
    """A switch that was scored: thresholds, rows in which it moves, levels off and on, gain, that less its price."""

    pair: Thresholds
    rows: float
    off: float
    on: float
    gain: float
    penalised: float


def _relay(scorer: Scorer, score: Score) -> Score | None:
    """The best switch at the site and by the driver of a score; None where none moves often enough."""
    driver = scorer.drivers[score.candidate.driver]
    low, high = np.quantile(driver, COVERED)
    even = np.linspace(low, high, THRESHOLDS + 2)[1:-1]
    best = _best(scorer, score, [(on, off) for off, on in combinations(even.tolist(), 2)])
    if best is None:
        return None
    step = (even[1] - even[0]) * np.linspace(-0.75, 0.75, BETWEEN)
    on, off = best.pair
    close = [(on + a, off + b) for a in step.tolist() for b in step.tolist() if on + a > off + b]
    best = _best(scorer, score, [best.pair, *close]) or best
    tried = [best, *(_best(scorer, score, [best.pair], rows) for rows in LAGS)]
    best = max((found for found in tried if found is not None), key=lambda found: found.penalised)
    variant = _variant(scorer, score, best)
    levels = {"amplitude": best.on} if variant.effect.form == RELAY else {"off": best.off, "on": best.on}
    return replace(
        score,
        variant=variant,
        gain=best.gain,
        penalised=best.penalised,
        start={**levels, "on_above": best.pair[0], "off_below": best.pair[1]},
    )


def _best(scorer: Scorer, score: Score, pairs: Sequence[Thresholds], rows: float = FOLLOWS) -> _Found | None:
    """The best pair of thresholds, with one level or two; None where no switch moves often enough.

    `rows` is the time constant with which it moves, in rows.
    """
    driver, site = scorer.drivers[score.candidate.driver], score.candidate.site
    courses = {pair: course(driver, *pair) for pair in pairs}
    often = {c.tobytes(): pair for pair, c in courses.items() if np.count_nonzero(c[1:] != c[:-1]) >= LEAST_MOVES}
    if not often:
        return None
    kept, offset = list(often.values()), site.mode == "offset"
    profiles = [TimeProfile(site.name, late(driver, *pair, rows), offset) for pair in kept]
    constant, X = np.split(
        scorer.projected_profiles([TimeProfile(site.name, np.ones(len(driver)), offset), *profiles]), [1], axis=1
    )
    price = float(np.log(scorer.measurements))
    numbers = PARAMETERS + (rows > FOLLOWS)
    gains, levels = _gains(X, scorer.residual)
    one = int(np.argmax(gains))
    found = _Found(kept[one], rows, 0.0, float(levels[one]), float(gains[one]), float(gains[one]) - numbers * price)
    own, level = _gains(constant, scorer.residual)
    turns = any(v.effect.family.turns for v in score.candidate.variants)  # two levels would draw that, and no better
    if turns or not own[0] > price:  # what is free already takes a constant up, or there is none
        return found
    base = constant / np.linalg.norm(constant)
    beside, more = _gains(X - base @ (base.T @ X), scorer.residual - base[:, 0] * float(base[:, 0] @ scorer.residual))
    two = int(np.argmax(beside))
    gain = float(own[0] + beside[two])
    if gain - (numbers + 1) * price <= found.penalised:
        return found
    off = float(level[0] - more[two] * (constant[:, 0] @ X[:, two]) / (constant[:, 0] @ constant[:, 0]))
    return _Found(kept[two], rows, off, off + float(more[two]), gain, gain - (numbers + 1) * price)


def _gains(X: FloatArray, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What each response (values, n) alone gains, and its size then (n,)."""
    along, strength = X.T @ residual, np.einsum("ij,ij->j", X, X)
    sure = strength > 1e-9 * np.max(strength, initial=1e-300)
    sizes = np.where(sure, along / np.where(sure, strength, 1.0), 0.0)
    return along * sizes, sizes


def late(driver: FloatArray, on_above: float, off_below: float, rows: float) -> FloatArray:
    """The course (N,) of a switch along a driver (N,) that moves with a time constant of some rows, from rest.

    Between the thresholds it stays where it has got to, as in the law of the form.
    """
    is_on = course(driver, on_above, off_below)
    if rows <= FOLLOWS:
        return is_on.astype(float)
    share, at = 1 - float(np.exp(-1 / rows)), float(is_on[0])
    moved = np.empty(len(driver))
    for k, (up, down) in enumerate(zip((driver > on_above).tolist(), (driver < off_below).tolist(), strict=True)):
        at += share * (1 - at) if up else -share * at if down else 0.0
        moved[k] = at
    return moved


def _variant(scorer: Scorer, score: Score, found: _Found) -> Variant:
    site, driver, offset = score.candidate.site, score.candidate.driver, score.candidate.site.mode == "offset"
    moved = late(scorer.drivers[driver], *found.pair, found.rows)
    settings = {"follow_s": found.rows * scorer.problem.record.dt}
    shape = ("on_above", found.pair[0]), ("off_below", found.pair[1])
    on = TimeProfile(site.name, moved, offset)
    if not found.off:
        return Variant(Effect(site.name, driver, RELAY, settings=settings), (on,), ("amplitude",), shape)
    off = TimeProfile(site.name, 1 - moved, offset)
    return Variant(Effect(site.name, driver, TWO_LEVELS, settings=settings), (off, on), ("off", "on"), shape)
