"""Search for what a model lacks, in innovations form: a few effects, each found by regression and then refitted.

A second effect is looked for beside each of the best first ones, not only beside the best: what is missing besides
decides which of two names is right.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, SWITCHED, Hypothesis, Kind
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.discovery.innovations.refit import Refit, Refitter
from adaptive_flot.discovery.innovations.screening import Screened, Screening
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray, Model

REFITTED, SAME_SITE = 6, 2
"""Suspects that are refitted, and of these at one site."""
LAGS_ELSEWHERE = 3
"""Lags that are refitted besides, one a site."""
HALTS = 2
"""Parts that are stuck for a time, which are refitted besides."""
BEAM = 3
"""Explanations that are carried on."""
MOST_EFFECTS = 2
LEAST_GAIN = 12.0
"""Gain of the criterion that another effect must bring."""
SLOW = ("lag", "store")
"""Kinds of effects that the fit of the model as it is hides in its constants: its stores have become larger."""
CONSTANT = ("gain", "offset")
"""Kinds of a constant change: a fit may start far from it, so that a regression on the model as it is overlooks it."""
FURTHEST = 4.0
"""Largest factor by which a fit of an effect starts: beyond, its first guess is a poor one."""


@dataclass(frozen=True)
class Explanation:
    """Effects, and the model with them in innovations form, fitted.

    Attributes
    ----------
    hypotheses
        The effects, in the order in which they act; none for the model as it is.
    fit
        The fit.
    numbers
        How many numbers were fitted for the effects, times of switches too.
    """

    hypotheses: tuple[Hypothesis, ...]
    fit: Refit
    numbers: int

    @property
    def criterion(self) -> float:
        """Half the Bayesian information criterion, its sign turned: log L - k / 2 log n."""
        n = int(np.count_nonzero(self.fit.rows))
        return self.fit.log_likelihood - self.numbers / 2 * float(np.log(n))

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the fitted coefficients."""
        return tuple(name for h in self.hypotheses for name in h.parameters)

    @property
    def names(self) -> frozenset[tuple[str, str, str]]:
        """What tells it from another one: site, driver and kind of each effect."""
        return frozenset((h.site, h.driver, h.kind) for h in self.hypotheses)


@dataclass(frozen=True)
class Search:
    """A record, and what is asked of it.

    Attributes
    ----------
    model
        The model as it is.
    record
        The record, without a gap.
    columns
        Indices of the outputs that count (m,).
    floor
        Noise of these from row to row (m,).
    free
        Names of the constants that are fitted with every explanation.
    known
        What is known of them before.
    processes
        Fits that run at once.
    kinds
        Kinds of effects that may be found; None for all.
    as_given
        The free constants as the model came, from which what is slow is fitted once more; none where they are known.
    since_reference
        Whether the constants that are known are those of a reference on which the model was right. Then gradual changes
        are looked for: what wanders is full of them, so a reference must say how much does. And the first effect is
        looked for beside those constants as well: without it they have moved to make up for it.
    ends
        Time of `time.monotonic` after which nothing more is looked for.
    """

    model: Model
    record: Dataset
    columns: tuple[int, ...]
    floor: FloatArray
    free: tuple[str, ...]
    known: Constants | None = None
    processes: int = 1
    kinds: tuple[str, ...] | None = None
    as_given: tuple[float, ...] = ()
    since_reference: bool = False
    ends: float = float("inf")

    @property
    def time_is_up(self) -> bool:
        """Whether the search has to end: what it has found by then may lack a better explanation."""
        return time.monotonic() > self.ends

    def model_of(self, explanation: Explanation) -> Model:
        """The model with the effects of an explanation and its fitted parameters."""
        model = self.model
        for h in explanation.hypotheses:
            model = model_with(model, h)
        p = explanation.fit.p
        return model.with_parameters({q.name: float(v) for q, v in zip(model.parameters, p, strict=True)})

    def started(self, explanation: Explanation, h: Hypothesis) -> Hypothesis:
        """One of its effects with the fitted coefficients to start from, for a fit of another kind."""
        model = self.model_of(explanation)
        values = {c: model.parameters[model.index("parameters", h.effect.parameter(c))].value for c in h.free}
        return replace(h, starts=(values,))

    def sizes(self, explanation: Explanation) -> tuple[dict[str, float], FloatArray]:
        """Fitted coefficients of the effects of an explanation by name, and their covariance (k, k)."""
        model, own = self.model_of(explanation), explanation.free
        values = {name: float(model.parameters[model.index("parameters", name)].value) for name in own}
        P = self.fitter(model, own).robust_covariance(explanation.fit)
        return values, P[len(self.free) :, len(self.free) :]

    def base(self, p: FloatArray) -> Explanation:
        """The model as it is, fitted from parameters (np,)."""
        return Explanation((), self.fitter(self.model, ()).fit(p), 0)

    def fitter(self, model: Model, own: Sequence[str]) -> Refitter:
        """Fits of a model with the constants and further parameters free."""
        return Refitter(model, self.record, self.columns, self.floor, (*self.free, *own), self.known)

    def run(self, base: Explanation, progress: Callable[[str], None] = lambda stage: None) -> list[Explanation]:
        """All explanations that were refitted, the best first; the model as it is among them."""
        found, beam, best = [base], [base], base
        for count in range(1, MOST_EFFECTS + 1):
            if self.time_is_up:
                break
            progress(f"innovations form: explanations of {count} effect{'s' if count > 1 else ''}")
            further = [e for start in beam for e in self._further(start)]
            ranked = _distinct(further)
            if count > 1:
                best_few = parallel_map(self.settled, ranked[: 2 * BEAM], self.processes)
                ranked = _distinct([*best_few, *ranked[2 * BEAM :]])
                found += self.events_alone(ranked[:BEAM])
            found += ranked
            if not ranked or ranked[0].criterion < best.criterion + LEAST_GAIN:
                break
            beam, best = ranked[:BEAM], ranked[0]
        return sorted(_distinct(found), key=lambda e: -worth(e))

    def events_alone(self, pairs: Sequence[Explanation]) -> list[Explanation]:
        """The event of each pair with one, without the other effect: its times may be better than those it had alone.

        An event that starts while constants make up for it may rest at a wrong time. A partner of no size then lets it
        go to the right one, and two effects would be told for one.
        """
        found = []
        for pair in pairs:
            others = [h for h in pair.hypotheses if h.kind not in EVENTS]
            if len(pair.hypotheses) == 2 and len(others) == 1:
                found.append(self.without(pair, others[0]))
        return [e for e in found if np.isfinite(e.fit.log_likelihood)]

    def _further(self, start: Explanation) -> list[Explanation]:
        """The explanation with one more effect, for each that is worth its numbers."""
        if self.time_is_up:
            return []
        screening, screened = self._screened(start)
        refits = self.all_with(start, _spread(screened))
        if self.since_reference and not start.hypotheses:
            held = self._held(start)
            _, beside = self._screened(held)
            constant = [s for s in beside if s.suspect.hypothesis.kind in CONSTANT and s.gain >= LEAST_GAIN]
            spread = [s for s in _spread(beside) if not any(s is c for c in constant)]
            refits += self.all_with(start, [*spread, *constant], held)
        switched = [e for e in refits if e.hypotheses[-1].kind in SWITCHED]
        if switched:
            switch = max(switched, key=lambda e: e.criterion).hypotheses[-1]
            there = [s for site in self.model.sites for s in screening.at_times_of(switch, site)]
            refits += self.all_with(start, there)
        return refits

    def _held(self, start: Explanation) -> Explanation:
        """The model as it is with the constants of the reference, and the noise of a fit to this record."""
        p, fit = self.model.parameter_values, start.fit
        return replace(start, fit=replace(fit, p=p, filtered=self.fitter(self.model, ()).run(p, fit.noise)))

    def _screened(self, start: Explanation) -> tuple[Screening, list[Screened]]:
        """The regressions on an explanation, and what may be found by them, the best first."""
        screening = self.screening(start, [s.name for s in self.model.sites])
        # one course in time at most: a second one would draw whatever is left
        events = all(h.driver != "time" for h in start.hypotheses) and self._may("switch")
        screened = screening.all(events=events, ramps=events and self.since_reference)
        return screening, [s for s in screened if self._may(s.suspect.hypothesis.kind)]

    def all_with(
        self, start: Explanation, chosen: Sequence[Screened], held: Explanation | None = None
    ) -> list[Explanation]:
        """The explanations with one of some effects more each, those that are worth their numbers.

        Fitted from `start`, or from what is `held` in its place.
        """
        at = start if held is None else held
        refits = parallel_map(lambda s: None if self.time_is_up else self._with(at, s), chosen, self.processes)
        return [e for e in refits if e is not None and e.criterion > start.criterion + LEAST_GAIN]

    @property
    def _modes(self) -> dict[str, Mode]:
        return {s.name: s.mode for s in self.model.sites}

    def _may(self, kind: str) -> bool:
        return self.kinds is None or kind in self.kinds

    def screening(self, start: Explanation, sites: Sequence[str]) -> Screening:
        """The regressions on an explanation, of changes at some sites."""
        model = self.model_of(start)
        fitter = self.fitter(model, start.free)
        return Screening(model, fitter.response(start.fit, sites), fitter.known_rows(start.fit.p))

    def settled(self, explanation: Explanation) -> Explanation:
        """The same, its switch placed anew beside the other effects, where that is better."""
        switch = next((h for h in explanation.hypotheses if h.kind in SWITCHED), None)
        if switch is None or len(explanation.hypotheses) < 2:
            return explanation
        without = self.without(explanation, switch)
        site = next(s for s in self.model.sites if s.name == switch.site)
        screening = self.screening(without, [site.name])
        placed = screening.switch(site) if switch.kind == "switch" else screening.halt(site)
        again = self._with(without, placed) if placed is not None else None
        return again if again is not None and again.criterion > explanation.criterion else explanation

    def switched_again(self, explanation: Explanation, switch: Hypothesis) -> float:
        """Gain of a further switch at the site of one that an explanation has; 0 where none is found."""
        site = next(s for s in self.model.sites if s.name == switch.site)
        again = self.screening(explanation, [site.name]).switch(site)
        return again.gain if again is not None else 0.0

    def without(self, explanation: Explanation, left_out: Hypothesis) -> Explanation:
        """The explanation without one of its effects, fitted anew."""
        others = tuple(h for h in explanation.hypotheses if h is not left_out)
        model = self.model
        for h in others:
            model = model_with(model, h)
        now = self.model_of(explanation)
        p = np.array([now.parameters[now.index("parameters", q.name)].value for q in model.parameters])
        fit = self.fitter(model, tuple(n for h in others for n in h.parameters)).fit(p, explanation.fit.size)
        return Explanation(others, fit, explanation.numbers - numbers_of(left_out))

    def late_elsewhere(self, explanation: Explanation, late: Hypothesis) -> list[Explanation]:
        """The explanation with one of its lags at another actuator or sensor instead, for each; not those that fail."""
        rest = self.without(explanation, late)
        sites = [s.name for s in self.model.sites if s.role in ("actuator", "sensor") and s.name != late.site]
        taken = {e.label for e in self.model_of(rest).effects}
        values, _ = self.fitter(self.model_of(rest), ()).response(rest.fit, sites).seen() if sites else ({}, {})
        (coefficient,) = late.free
        fitted = self.model_of(explanation)
        tau = float(fitted.parameters[fitted.index("parameters", late.effect.parameter(coefficient))].value)
        found = []
        for site in sites:
            size = ordinary_size(values[site])
            told = {"amplitude": 1.0, coefficient: tau}
            effect = Effect(site, "lag", late.effect.form, told, {"scale": size or 1.0})
            if effect.label in taken or not np.isfinite(size):
                continue
            moved = Hypothesis(site, "lag", late.kind, effect, late.free, ({},), {}, late.scales)
            p = model_with(self.model_of(rest), moved).parameter_values
            again = self._better_start(rest, moved, p)
            found += [again] if np.isfinite(again.fit.log_likelihood) else []
        return found

    def added(self, start: Explanation, h: Hypothesis, p: FloatArray) -> Explanation:
        """The explanation with an effect more, fitted from parameters of the model with it (np,)."""
        model = model_with(self.model_of(start), h)
        fit = self.fitter(model, (*start.free, *h.parameters)).fit(p, start.fit.size)
        return Explanation((*start.hypotheses, h), fit, start.numbers + numbers_of(h))

    def of_effects(self, effects: Sequence[Effect], fitted: Model, names: Sequence[str]) -> Explanation | None:
        """Effects of a free run, fitted in innovations form; None where they can not be.

        Parameters
        ----------
        effects
            The effects, in their order.
        fitted
            The model with them as the free run has fitted it.
        names
            Names of its fitted parameters.
        """
        values = {q.name: q.value for q in fitted.parameters}
        model, own, numbers = self.model, list[Hypothesis](), 0
        for effect in effects:
            found = [c for c in effect.terms if effect.parameter(c.name) in names]
            told = {c.name: values[name] for c in found if (name := effect.parameter(c.name)) in values}
            times = effect.names(CoefficientRole.ONSET, CoefficientRole.DURATION)  # those of an event stay as they are
            free = tuple(c.name for c in found if c.name not in times)
            kind: Kind = "ramp" if effect.form == "ramp" else "lag" if _is_lag(effect, free) else "alternative"
            h = Hypothesis(effect.site, effect.driver, kind, effect, free, ({},))
            own.append(h.with_scales(told, self._modes[effect.site]))
            model, numbers = model_with(model, own[-1]), numbers + len(found)
        p = np.array([values.get(q.name, q.value) for q in model.parameters])
        fit = self.fitter(model, tuple(name for h in own for name in h.parameters)).fit(p)
        if not np.isfinite(fit.log_likelihood):
            return None
        return Explanation(tuple(own), fit, numbers)

    def _with(self, start: Explanation, screened: Screened) -> Explanation | None:
        told = dict(zip(screened.suspect.coefficients, map(float, screened.size), strict=True))
        h = screened.suspect.hypothesis
        h = h.with_scales({**h.effect.coefficients, **told}, self._modes[h.site])
        model = model_with(self.model_of(start), h)
        p = model.parameter_values
        p[: len(start.fit.p)] = start.fit.p
        for name, value in told.items():
            q = model.parameters[model.index("parameters", h.effect.parameter(name))]
            first = np.log(np.clip(1 + value, 1 / FURTHEST, FURTHEST)) if h.effect.mode == "factor" else value
            p[model.index("parameters", q.name)] = np.clip(first, q.lower, q.upper)
        again = self._better_start(start, h, p) if h.kind in SLOW and not start.hypotheses else self.added(start, h, p)
        return again if np.isfinite(again.fit.log_likelihood) else None

    def _better_start(self, start: Explanation, h: Hypothesis, p: FloatArray) -> Explanation:
        """An effect more that is slow, fitted from parameters (np,), and with the constants as the model came.

        The fit of the model as it is has made a store larger for a lag that it lacks: from there the lag stays short.
        """
        starts = [p]
        if self.as_given:
            starts.append(p.copy())
            starts[1][list(model_with(self.model_of(start), h).indices("parameters", self.free))] = self.as_given
        refits = [self.added(start, h, each) for each in starts]
        return max(refits, key=lambda e: (bool(np.isfinite(e.fit.log_likelihood)), e.criterion))


def worth(explanation: Explanation) -> float:
    """The criterion, less what each effect must gain: two effects stand for one only where they explain so much more.

    The criterion charges numbers. That two things are wrong at a time is less likely than that one is.
    """
    return explanation.criterion - LEAST_GAIN * len(explanation.hypotheses)


def numbers_of(h: Hypothesis) -> int:
    """How many numbers a hypothesis was fitted by, those taken from a grid and the times of a switch too."""
    told = h.effect.coefficients.items() if h.kind in EVENTS else ()
    times = [c for c, v in told if c.startswith(("on_", "for_", "onset", "duration")) and v < FOREVER]
    return len(h.free) + len(times)


def _is_lag(effect: Effect, free: Sequence[str]) -> bool:
    """Whether a free run has fitted what the search calls a lag: a time constant, and nothing else."""
    return effect.form == "lag" and len(free) == 1 and free == effect.names(CoefficientRole.TIME_CONSTANT)


def _spread(ranked: Sequence[Screened]) -> list[Screened]:
    """The best few, one of a kind and few at one site; the best store, which most models leave out; and what is hidden.

    Process noise follows what a lag does, and the filter what a sensor shows that has stopped. A regression says little
    of either.
    """
    chosen: list[Screened] = []
    for s in ranked:
        h = s.suspect.hypothesis
        same = [c.suspect.hypothesis for c in chosen if c.suspect.hypothesis.site == h.site]
        if s.gain > 0 and len(same) < SAME_SITE and all((c.kind, c.driver) != (h.kind, h.driver) for c in same):
            chosen.append(s)
        if len(chosen) == REFITTED:
            break
    stores = [s for s in ranked if s.suspect.hypothesis.kind == "store" and s.gain >= LEAST_GAIN]
    further = [] if any(s in chosen for s in stores) else stores[:1]
    halts = [s for s in ranked if s.suspect.hypothesis.kind == "stuck for a time" and s.gain >= LEAST_GAIN]
    further += [s for s in halts[:HALTS] if s not in chosen]
    by_site = {
        s.suspect.hypothesis.site: s for s in reversed(ranked) if s.suspect.hypothesis.kind == "lag" and s.gain > 0
    }
    lags = sorted((s for s in by_site.values() if s not in chosen), key=lambda s: -s.gain)
    return [*chosen, *further, *lags[:LAGS_ELSEWHERE]]


def _distinct(found: Sequence[Explanation]) -> list[Explanation]:
    """The best of each set of effects, the best first."""
    kept: dict[frozenset[tuple[str, str, str]], Explanation] = {}
    for e in sorted(found, key=lambda e: -e.criterion):
        kept.setdefault(e.names, e)
    return list(kept.values())
