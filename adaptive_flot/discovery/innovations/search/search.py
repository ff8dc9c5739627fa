"""A record in innovations form, and what is asked of it: fits of the model with effects, and regressions on them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import SWITCHED, Hypothesis, Kind
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.seen import ordinary_size
from adaptive_flot.discovery.innovations.filter.refit import ITERATIONS, Refitter
from adaptive_flot.discovery.innovations.screening import Screened, Screening
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation, numbers_of
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.parallel import parallel_map

SLOW = ("lag", "store")
"""Kinds of effects that the fit of the model as it is hides in its constants: its stores have become larger."""
FURTHEST = 4.0
"""Largest factor by which a fit of an effect starts: beyond, its first guess is a poor one."""
STARTS = (1.0, 0.6, 0.35, 0.2, 0.1, 0.05, 0.02, 0.005)
"""Shares of a first guess from which the best is taken: a regression that moves the constants far, too, misleads."""

BEGUN = 2
"""Steps of a fit after which it is compared with the others; but for what is slow, which may come up late."""
FAR, FAR_SHARE = 100.0, 0.5
"""What is behind the best by so much, and by this share of what the best gains, is not fitted to the end. Of 61 fits on
a record of three tanks none gained more than 57 after two steps."""


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
    noise
        Factors of the noise that no fit changes; None where they are fitted.
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
    noise: tuple[float, float] | None = None
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

    def coefficient(self, explanation: Explanation, h: Hypothesis, name: str) -> float:
        """A fitted coefficient of one of its effects."""
        model = self.model_of(explanation)
        return float(model.parameters[model.index("parameters", h.effect.parameter(name))].value)

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
        return Refitter(model, self.record, self.columns, self.floor, (*self.free, *own), self.known, held=self.noise)

    def all_with(
        self, start: Explanation, chosen: Sequence[Screened], held: Explanation | None = None
    ) -> list[Explanation]:
        """The explanations with one of some effects more each, those that are worth their numbers.

        Fitted from `start`, or from what is `held` in its place. What is far behind the best after a few steps is left
        as it is. Jamieson & Talwalkar, *AISTATS* (2016) 240, on successive halving.
        """
        at = start if held is None else held
        refits = parallel_map(lambda s: None if self.time_is_up else self._with(at, s, BEGUN), chosen, self.processes)
        begun = [e for e in refits if e is not None]
        best = max((e.criterion for e in begun), default=start.criterion)
        bar = best - max(FAR, FAR_SHARE * (best - start.criterion))
        ended = parallel_map(lambda e: e if e.criterion < bar else self._to_the_end(e), begun, self.processes)
        return [e for e in ended if e.criterion > start.criterion + LEAST_GAIN]

    def _to_the_end(self, begun: Explanation) -> Explanation:
        """The explanation, fitted until nothing is gained that counts; as it is where it was."""
        if begun.fit.at_rest or self.time_is_up:
            return begun
        fit = self.fitter(self.model_of(begun), begun.free).fit(begun.fit.p, begun.fit.size)
        return replace(begun, fit=fit) if fit.log_likelihood > begun.fit.log_likelihood else begun

    @property
    def _modes(self) -> dict[str, Mode]:
        return {s.name: s.mode for s in self.model.sites}

    def may(self, kind: str) -> bool:
        """Whether effects of a kind may be found."""
        return self.kinds is None or kind in self.kinds

    def screening(self, start: Explanation, sites: Sequence[str]) -> Screening:
        """The regressions on an explanation, of changes at some sites."""
        model = self.model_of(start)
        fitter = self.fitter(model, start.free)
        return Screening(model, fitter.response(start.fit, sites), fitter.space.known_rows(start.fit.p))

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
        # constants as they are beside the lag: without it they have moved to make up for it
        constants = explanation.fit.p[list(fitted.indices("parameters", self.free))]
        found = []
        for site in sites:
            size = ordinary_size(values[site])
            told = {"amplitude": 1.0, coefficient: tau}
            effect = Effect(site, late.driver, late.effect.form, told, {**late.effect.settings, "scale": size or 1.0})
            if effect.label in taken or not np.isfinite(size):
                continue
            moved = Hypothesis(site, late.driver, late.kind, effect, late.free, ({},), {}, late.scales)
            there = model_with(self.model_of(rest), moved)
            p = there.parameter_values
            p[list(there.indices("parameters", self.free))] = constants
            again = self._better_start(rest, moved, p)
            found += [again] if np.isfinite(again.fit.log_likelihood) else []
        return found

    def added(self, start: Explanation, h: Hypothesis, p: FloatArray, iterations: int = ITERATIONS) -> Explanation:
        """The explanation with an effect more, fitted from parameters of the model with it (np,), or a share of it.

        With so many steps of a fit at most.
        """
        model = model_with(self.model_of(start), h)
        fitter = self.fitter(model, (*start.free, *h.parameters))
        if h.kind not in SLOW:  # a time constant that starts short stays short
            shares = np.ones((len(STARTS), len(p)))
            shares[:, list(model.indices("parameters", h.parameters))] = np.array(STARTS)[:, None]
            p = p * shares[np.argmin(fitter.costs(p * shares, start.fit.size))]
        fit = fitter.fit(p, start.fit.size, iterations=iterations)
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

    def _with(self, start: Explanation, screened: Screened, iterations: int = ITERATIONS) -> Explanation | None:
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
        if h.kind not in SLOW:
            again = self.added(start, h, p, iterations)
        else:
            again = self.added(start, h, p) if start.hypotheses else self._better_start(start, h, p)
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


def _is_lag(effect: Effect, free: Sequence[str]) -> bool:
    """Whether a free run has fitted what the search calls a lag: a time constant, and nothing else."""
    return effect.form == "lag" and len(free) == 1 and free == effect.names(CoefficientRole.TIME_CONSTANT)
