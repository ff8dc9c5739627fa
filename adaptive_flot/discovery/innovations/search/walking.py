"""Whether an event that comes again and again is a quantity that wanders: its value walks, and nothing is switched.

Enough spells of the right lengths draw any course. So the event is held against a random walk of the value at its site,
with one number, its rate s::

    dA = s dw,   A = 0 at the start

What is switched is explained better by the switch, and what wanders by the walk. A single change that stays is no such
question: a walk follows one, and all else that the model lacks there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.joint.known_before import at_rest
from adaptive_flot.discovery.innovations.events.at_times import times_of_switch
from adaptive_flot.discovery.innovations.filter.refit import UNSURE
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.filtering import NoiseModel, RecordFilter
from adaptive_flot.greybox.filtering.likelihood import first_state
from adaptive_flot.greybox.model import FloatArray

AGAIN = 3
"""Spells from which an event comes again and again."""
RATES = np.geomspace(0.1, 10.0, 9)
"""Rates that are tried: a walk comes to so many times the size of the event between two of its edges."""
SMALLER = (1.0, 0.3, 0.1, 0.03)
"""Shares of the process noise without the event that are tried: the walk takes the place of some of it."""
SIZES = (1.0, 0.6)
"""Shares of the size of an event with which a single spell of it is tried."""


def comes_again(h: Hypothesis) -> bool:
    """Whether an event is a switch that comes again and again."""
    return h.kind == "switch" and len(h.pulses) >= AGAIN


def gain_of_a_walk(search: Search, explanation: Explanation, rest: Explanation, event: Hypothesis) -> float:
    """What the criterion gains over an explanation without an event where the value at its site walks instead.

    The constants are those with the event or without, so that a fit of the walk would gain more; zero where it can not
    be filtered.
    """
    effect = Effect(event.site, "constant", "shift", mode=event.effect.mode)
    without = search.model_of(rest)
    if effect.label in {e.label for e in without.effects}:
        return 0.0
    model, walks = without.with_effects([effect]), effect.parameter("amplitude")
    run = _Walk(search, rest, RecordFilter(model, search.record.dt, search.columns, (walks,)))
    size = abs(search.coefficient(explanation, event, "amplitude"))
    between = float(search.record.time[-1] - search.record.time[0]) / (2 * len(event.pulses))
    known = [{q.name: q.value for q in m.parameters} for m in (search.model_of(explanation), without)]
    points = [np.array([each.get(q.name, 0.0) for q in model.parameters]) for each in known]
    noises = run.noises(explanation.fit.size, size * RATES / np.sqrt(between))
    best = max((run.log_likelihood(noise, p) for noise, p in product(noises, points)), default=-np.inf)
    plain = float(np.sum(rest.fit.rows))
    numbers = float(np.log(np.count_nonzero(rest.fit.rows))) / 2
    return max(best - plain - numbers, 0.0)


class _Walk:
    """The filter of a model one of whose parameters walks, over the record of a search."""

    def __init__(self, search: Search, rest: Explanation, record_filter: RecordFilter) -> None:
        self._search, self._filter, self._rest = search, record_filter, rest
        self._plain = search.fitter(search.model_of(rest), rest.free)

    def noises(self, beside: tuple[float, float], rates: FloatArray) -> Iterator[NoiseModel]:
        """Noise without the event, or less of it, or as it is `beside` the event, with each rate of the walk."""
        theta, rho = self._rest.fit.size
        sizes = {*((share * theta, rho) for share in SMALLER), beside}
        (name,) = self._filter.walking
        for size, rate in product(sorted(sizes), rates.tolist()):
            yield replace(self._plain.noise(size), walk={name: rate})

    def log_likelihood(self, noise: NoiseModel, p: FloatArray) -> float:
        """Of the record; minus infinity where the filter fails."""
        model, record = self._filter.model, self._search.record
        z, P = first_state(model, record, noise, p)
        states = len(model.states)
        z[:states] = at_rest(model, z[:states], record)
        with np.errstate(all="ignore"):
            rows = self._filter.run(record, noise, z, UNSURE**2 * P, p).log_likelihood
        return float(np.sum(rows)) if np.isfinite(rows).all() else -np.inf


def told_once(search: Search, explanation: Explanation, rest: Explanation, event: Hypothesis) -> Explanation | None:
    """The explanation whose event is there once, from a beginning of it to an end; None where none can be fitted."""
    begins, ends = [b for b, _ in event.pulses], [b + long for b, long in event.pulses]
    spells = [(b, min(e - b, FOREVER)) for b in begins for e in (*ends, b + FOREVER) if e > b]
    own = [replace(event, effect=_spell(event.effect, spell)) for spell in dict.fromkeys(spells)]
    known = {q.name: q.value for q in search.model_of(explanation).parameters}
    model = model_with(search.model_of(rest), own[0])
    fitter = search.fitter(model, (*rest.free, *own[0].parameters))
    where = model.index("parameters", event.effect.parameter("amplitude"))
    times = [event.effect.parameter(name) for name in ("on_1", "for_1")]
    tried, points = [], []
    for h, share in product(own, SIZES):
        p = np.array([known.get(q.name, q.value) for q in model.parameters])
        p[list(model.indices("parameters", times))] = [h.effect.coefficients[n] for n in ("on_1", "for_1")]
        p[where] *= share
        tried.append(h)
        points.append(p)
    costs = fitter.costs(np.array(points), explanation.fit.size)
    best = int(np.argmin(costs))
    once = search.added(rest, tried[best], points[best])
    return once if np.isfinite(once.fit.log_likelihood) else None


def _spell(effect: Effect, spell: tuple[float, float]) -> Effect:
    return replace(effect, coefficients=times_of_switch([spell]), settings={**effect.settings, "count": 1.0})
