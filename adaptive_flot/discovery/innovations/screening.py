"""Which further effects are worth a refit: a regression of the innovations on what each would do to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.further_sites.places import is_further
from adaptive_flot.discovery.hypotheses.families import FOREVER, LEAST_MOVE, Hypothesis, constant_change
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.discovery.innovations.courses import Suspect, periodic, suspects
from adaptive_flot.discovery.innovations.events.at_times import (
    cycle_at,
    halt_at,
    late_after,
    pulse_of,
    ramp_between,
    switch_at,
)
from adaptive_flot.discovery.innovations.events.cycling import best_cycle, is_on, possible_periods, refined_period
from adaptive_flot.discovery.innovations.events.halting import MOST_EDGES as HALTS
from adaptive_flot.discovery.innovations.events.halting import Halt, best_halt, still_stretch
from adaptive_flot.discovery.innovations.events.switching import MOST_EDGES, IntArray, Switch, best_switch
from adaptive_flot.discovery.innovations.filter.linear_response import LinearResponse
from adaptive_flot.greybox.effects import Mode
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site

NOTHING = 1e-9
CERTAIN = 0.5
"""Gain of log-likelihood for each row of a sensor that is still: what its spread says when it falls to its noise."""
BALANCE = ("process", "flow", "feed")
"""Roles of sites whose value enters a balance."""
SHARP = 6.0
"""Gain of log-likelihood by which edges within a row must be better than slow ones."""
RAMP_ENDS, NEARER, ZOOMS = 21, 5, 2
"""Times between which ramps begin and end, those about either of them in a finer grid, and how often it is refined."""


@dataclass(frozen=True)
class Screened:
    """A suspect, its coefficients by the regression (f,), and what it gains: log-likelihood less k / 2 log n."""

    suspect: Suspect
    size: FloatArray
    gain: float


class Screening:
    """The regressions on one fit: what its own free parameters explain is taken out first.

    The gain of a course is ``n / 2 log(rss_0 / rss_1)``: the spread of the innovations is fitted with and without it.

    Parameters
    ----------
    model
        The fitted model.
    response
        How its innovations answer.
    known
        What is known before of the free parameters as further rows: their slopes (c, q), and what is to be explained
        (c,). Without it a change that looks like another constant is taken for that, however well the constant is
        known.
    """

    def __init__(
        self, model: Model, response: LinearResponse, known: tuple[FloatArray, FloatArray] | None = None
    ) -> None:
        self.model, self._response = model, response
        slopes, told = known if known is not None else (np.empty((0, response.by_constants.shape[1])), np.empty(0))
        self._further = len(told)
        self._basis = span(np.vstack([response.by_constants, slopes]))
        innovations = np.concatenate([response.innovations, told])
        self._left = innovations - self._basis @ (self._basis.T @ innovations)
        self._total = float(self._left @ self._left)
        self._count = int(np.count_nonzero(response.innovations))
        self._values, self._drivers = response.seen()

    def seen(self, site: str) -> FloatArray:
        """Values at a site (N - 1,)."""
        return self._values[site]

    def all(self, *, events: bool, ramps: bool = False) -> list[Screened]:
        """Every suspect, the best first; with changes in time or without, and with gradual ones or without.

        Empty where the filter has run off: nothing can be regressed on it.
        """
        record = self._response.record
        if not all(np.isfinite(v).all() for v in (self._left, *self._values.values(), *self._drivers.values())):
            return []
        by_site: dict[str, list[Suspect]] = {}
        for s in suspects(self.model, self._values, self._drivers, record.dt):
            by_site.setdefault(s.hypothesis.site, []).append(s)
        found = [x for site, group in by_site.items() for x in self._regressions(site, group)]
        if events:
            found += [x for site in self.model.sites if (x := self.switch(site)) is not None]
            found += [x for site in self.model.sites if (x := self.halt(site)) is not None]
            swings = {site.name: self._swings(site) for site in self.model.sites}
            found += [x for each in swings.values() for x in each]
            found += [x for site in self.model.sites if (x := self.cycle(site, swings[site.name])) is not None]
        if ramps:
            found += [x for site in self.model.sites if (x := self.ramp(site)) is not None]
        return sorted(found, key=lambda x: -x.gain)

    def switch(self, site: Site) -> Screened | None:
        """The best switch at a site; None where none is worth its times.

        What enters or leaves a balance may also change by an amount, whatever else it depends on: people who are not
        counted, while nobody is. A model with a site for such amounts has that already. And a force, to which amounts
        are added, may change by a factor: a spring that is half as stiff.
        """
        found = [self._switch(site, mode) for mode in self._modes_of_switch(site)]
        return max((x for x in found if x is not None), key=lambda x: x.gain, default=None)

    def _modes_of_switch(self, site: Site) -> tuple[Mode, ...]:
        if site.role not in BALANCE or is_further(site.name):  # a balance by a factor is another store, a further site
            return (site.mode,)
        if site.mode == "offset":
            return (site.mode, "factor")
        amounts = any(s.mode == "offset" for s in self.model.sites if s.role in BALANCE)
        return (site.mode,) if amounts else (site.mode, "offset")

    def at_times_of(self, switch: Hypothesis, site: Site) -> list[Screened]:
        """A switch at the times of another one, at a site, whatever it gains: by a factor, by an amount, or either.

        A regression takes an event for small. Half of a fan's air is not: its own event may not even come in sight.
        None of what the record says nothing of, and not the switch itself.
        """
        own = switch.site, switch.effect.mode
        modes = (mode for mode in self._modes_of_switch(site) if (site.name, mode) != own)
        return [x for mode in modes if (x := self._at_times_of(switch, site, mode)) is not None]

    def _at_times_of(self, switch: Hypothesis, site: Site, mode: Mode) -> Screened | None:
        record, by = self._response.record, self._course(site, mode)
        if by is None:
            return None
        late = {s.name: late_after(s, record.dt) for s in self.model.sites}
        pulses = [(on + late[site.name] - late[switch.site], length) for on, length in switch.pulses]
        mask = np.zeros(len(by), dtype=bool)
        for on, length in pulses:
            mask |= (record.time[1:] > on) & (record.time[1:] <= on + length)
        numbers = sum(1 + (length < FOREVER) for _, length in pulses)
        hypothesis = switch_at(site, mode, pulses, record.dt)
        suspect = Suspect(hypothesis, (by * mask)[:, None], hypothesis.free, numbers)
        return next(iter(self._regressions(site.name, [suspect])), None)

    def _course(self, site: Site, mode: Mode) -> FloatArray | None:
        """Change of a site's value by an event of size 1 (N - 1,); None where the record says nothing of the site."""
        by = self._values[site.name] if mode == "factor" else np.ones(len(self._response.record) - 1)
        return by if np.isfinite(by).all() and np.abs(by).max() > 0 else None

    def _switch(self, site: Site, mode: Mode) -> Screened | None:
        record, count = self._response.record, len(self._response.record) - 1
        by = self._course(site, mode)
        if by is None:
            return None
        apart = max(1, -(-count // MOST_EDGES))
        switch = self._best_switch(site.name, by, np.arange(1, count - 1, apart))
        if switch is not None and apart > 1:
            near = switch.edges(count)[:, None] + np.arange(1 - apart, apart)
            again = self._best_switch(site.name, by, np.unique(near[(near > 0) & (near < count - 1)]))
            switch = again if again is not None and again.gain > switch.gain else switch
        if switch is None or not self._is_sharp(site.name, by, switch):
            return None
        numbers = sum(1 + (b < count) for _, b in switch.pulses)
        pulses = [pulse_of(site, record, a, b) for a, b in switch.pulses]
        hypothesis = switch_at(site, mode, pulses, record.dt)
        suspect = Suspect(hypothesis, (by * switch.mask(count))[:, None], hypothesis.free, numbers)
        return Screened(suspect, np.array([switch.size]), switch.gain - self._charge(suspect))

    def halt(self, site: Site) -> Screened | None:
        """The best time for which an actuator or sensor stays at a level; None where a constant change does as well."""
        v, record = self._values[site.name], self._response.record
        spread = float(np.ptp(v))
        if site.role not in ("actuator", "sensor") or not spread > LEAST_MOVE * ordinary_size(v):
            return None
        found = self._still(site) if site.role == "sensor" else self._halt(site, v)
        if found is None:
            return None
        on, length = pulse_of(site, record, found.begin, found.end)
        hypothesis = halt_at(site, v, found.level, (on, length), record.dt)
        stands = (np.arange(len(v)) >= found.begin) & (np.arange(len(v)) < found.end)
        suspect = Suspect(hypothesis, ((found.level - v) * stands)[:, None], (), 2 + (length < FOREVER))
        return Screened(suspect, np.empty(0), found.gain - self._charge(suspect))

    def _halt(self, site: Site, v: FloatArray) -> Halt | None:
        """When an actuator stays at a level, by its response."""
        count = len(v)
        apart = max(1, -(-count // HALTS))
        found = self._best_halt(site, v, np.arange(1, count - 1, apart))
        if found is not None and apart > 1:
            near = np.array([e for e in (found.begin, found.end) if e < count])[:, None] + np.arange(1 - apart, apart)
            again = self._best_halt(site, v, np.unique(near[(near > 0) & (near < count - 1)]))
            found = again if again is not None and again.gain > found.gain else found
        return found if found is not None and found.beyond >= SHARP + float(np.log(self._count)) / 2 else None

    def _best_halt(self, site: Site, v: FloatArray, edges: IntArray) -> Halt | None:
        count = len(v)
        after = (np.arange(count)[:, None] >= edges[None, :]).astype(float)
        moved, one = (self._rest(self._response.respond(site.name, steps)) for steps in (after * v[:, None], after))
        if not (np.isfinite(moved).all() and np.isfinite(one).all()):
            return None
        return best_halt((moved, one), edges, self._left, count, self._count, (float(v.min()), float(v.max())))

    def _still(self, site: Site) -> Halt | None:
        """When the sensor of an output shows nothing but noise; as if each row of it gained as much as one can."""
        shown = self._response.shown_by(site.name)
        if shown is None:
            return None
        measured, noise = shown
        found = still_stretch(measured[1:], noise)
        if found is None:
            return None
        begin, end, level = found
        return Halt(begin, end, level, CERTAIN * (end - begin), np.inf)

    def constant(self, site: Site) -> list[Screened]:
        """A constant change in the way of a site, whatever it gains; none where the record says nothing of the site."""
        by = self._course(site, site.mode)
        if by is None:
            return []
        hypothesis = constant_change(site, float(np.ptp(self._values[site.name])))
        return self._regressions(site.name, [Suspect(hypothesis, by[:, None], ("amplitude",))])

    def ramp(self, site: Site) -> Screened | None:
        """The best gradual change at a site, after which it stays; None where the record says nothing of the site."""
        record, count = self._response.record, len(self._response.record) - 1
        by = self._course(site, site.mode)
        if by is None:
            return None
        grid = np.unique(np.linspace(0, count, RAMP_ENDS).astype(int))
        pairs = [(a, b) for a in grid[:-1] for b in grid[1:] if b > a]
        best: Screened | None = None
        for zoom in range(ZOOMS + 1):
            group = [ramp_between(site, by, record, a, b) for a, b in pairs]
            best = max(self._regressions(site.name, group), key=lambda x: x.gain, default=None)
            if best is None:
                return None
            at = next(pair for pair, suspect in zip(pairs, group, strict=True) if suspect is best.suspect)
            reach = count / (RAMP_ENDS - 1) / NEARER**zoom
            begins, ends = ((k + np.linspace(-reach, reach, 2 * NEARER - 1)).astype(int) for k in at)
            pairs = [(a, b) for a in np.unique(begins) for b in np.unique(ends) if 0 <= a < b - 1 and b <= count]
        return best

    def swing(self, site: Site, period: float | None = None) -> Screened | None:
        """The wave at a site that explains most, or that of a `period` [s]; None where none can be."""
        return max(self._swings(site, period), key=lambda s: s.gain, default=None)

    def cycle(self, site: Site, swings: Sequence[Screened] = (), period: float | None = None) -> Screened | None:
        """The best switch in every period [s] at a site: as given, of a clock, or about that of some waves there.

        None where the record tells it from no wave with its second harmonic, or says nothing of the site.
        """
        record, by = self._response.record, self._course(site, site.mode)
        if by is None:
            return None
        time, dt = record.time[1:] - (record.dt / 2 - late_after(site, record.dt)), record.dt

        def respond(courses: FloatArray) -> FloatArray:
            return self._rest(self._response.respond(site.name, courses))

        periods = possible_periods(len(by) * dt, dt) if period is None else [period]
        wave = max(swings, key=lambda s: s.gain, default=None)
        if wave is not None and wave.gain > 0:
            near = wave.suspect.hypothesis.effect.coefficients["period"]
            periods.append(refined_period(respond, self._left, by, time, dt, near))
        found = [c for p in periods if (c := best_cycle(respond, self._left, by, time, dt, p)) is not None]
        best = max(found, key=lambda c: c.explained, default=None)
        if best is None:
            return None
        turns = 2 * np.pi * np.outer(time, [1.0, 2.0]) / best.period
        smooth = respond(by[:, None] * np.column_stack([np.sin(turns), np.cos(turns)]))
        gain, other = (self._gain(left) for left in (self._total - best.explained, self._linear(smooth)[1]))
        if gain - other < SHARP:
            return None
        course = (by * is_on(time, best.period, best.onset, best.duration))[:, None]
        suspect = Suspect(cycle_at(site, best, dt), course, ("amplitude",), 3)
        return Screened(suspect, np.array([best.size]), gain - self._charge(suspect))

    def _gain(self, left: float) -> float:
        """Log-likelihood gained by what leaves so many squares."""
        return self._count / 2 * float(np.log(self._total / max(left, NOTHING * self._total)))

    def _is_sharp(self, site: str, by: FloatArray, switch: Switch) -> bool:
        """Whether the record tells the switch from a slow course: what wanders is not switched."""
        slow = self._rest(self._response.respond(site, (by * switch.slow(len(by)))[:, None]))
        return switch.gain - self._gain(self._linear(slow)[1]) >= SHARP

    def _best_switch(self, site: str, by: FloatArray, edges: IntArray) -> Switch | None:
        count = len(by)
        steps = (np.arange(count)[:, None] >= edges[None, :]) * by[:, None]
        return best_switch(self._rest(self._response.respond(site, steps)), edges, self._left, count)

    def _swings(self, site: Site, period: float | None = None) -> list[Screened]:
        record = self._response.record
        group = list(periodic(site, self._values[site.name], record.time[1:], record.dt, period))
        return self._regressions(site.name, group) if group else []

    def _regressions(self, site: str, group: list[Suspect]) -> list[Screened]:
        X = self._rest(self._response.respond(site, np.column_stack([s.courses for s in group])))
        found, at = [], 0
        for s in group:
            x = X[:, at : at + s.courses.shape[1]]
            at += s.courses.shape[1]
            if not np.isfinite(x).all():
                continue
            none: tuple[FloatArray, float] = (np.empty(0), self._all_or_nothing(x[:, 0]))
            size, left = self._linear(x) if s.coefficients else none
            found.append(Screened(s, size, self._gain(left) - self._charge(s)))
        return found

    def _linear(self, x: FloatArray) -> tuple[FloatArray, float]:
        size: FloatArray = np.asarray(np.linalg.lstsq(x, self._left, rcond=1e-9)[0], dtype=float)
        return size, float(np.sum((self._left - x @ size) ** 2))

    def _all_or_nothing(self, x: FloatArray) -> float:
        """Squares left by a change that is all or nothing; it is far, so that any share of its response counts."""
        product = max(float(x @ self._left), 0.0)
        return self._total - product**2 / max(float(x @ x), 1e-300)

    def _charge(self, suspect: Suspect) -> float:
        # of a change that is all or nothing the regression still chooses the share
        numbers = suspect.cost + (not suspect.coefficients)
        return numbers / 2 * float(np.log(self._count))

    def _rest(self, X: FloatArray) -> FloatArray:
        """Responses (n, f), and that what is known before does not answer, less what the free parameters explain."""
        X = np.vstack([X, np.zeros((self._further, X.shape[1]))])
        left: FloatArray = X - self._basis @ (self._basis.T @ X)
        return left


def span(X: FloatArray) -> FloatArray:
    """Orthonormal columns that span those of X (n, r)."""
    length = np.linalg.norm(X, axis=0)
    U, s, _ = np.linalg.svd(X[:, length > 0] / length[length > 0], full_matrices=False)
    found: FloatArray = U[:, s > NOTHING * s.max()] if len(s) else U
    return found
