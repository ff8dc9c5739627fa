"""Fits of alternatives to one problem: adapted parameters, initial state and effect coefficients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from adaptive_flot.discovery.fitting.descent import Descent
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.unknowns import Unknowns
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.model import Model

MOST_STEPS = 16
"""Steps for one noise model."""
NOISE_ROUNDS = 3
MOST_RESTARTS = 4
SETTLED = 1.0
"""Gain in minus two log-likelihood of a restart below which a fit is where it stays."""


def at_its_constants(problem: Problem, fit: Fit) -> Fit:
    """The fit with a model that has what its background came to, but for the feed: little is left to be linear."""
    if problem.background is None:
        return fit
    return replace(fit, model=problem.background.at_its_values(fit.background, fit.model))


class Fitter:
    """Fits of alternatives to one problem. Immutable; every call is independent."""

    def __init__(self, problem: Problem, splits: tuple[str, ...] = ("estimate",)) -> None:
        self.problem, self.splits = problem, splits
        self.rows = problem.rows(*splits)

    def fit(
        self,
        model: Model,
        free: tuple[str, ...] = (),
        start: Mapping[str, float] | None = None,
        like: Fit | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        rounds: int = NOISE_ROUNDS,
        steps: int = MOST_STEPS,
        shrink: Sequence[str] = (),
        noise: Noise | None = None,
    ) -> Fit | None:
        """Fit the adapted parameters, the initial state and the parameters `free`.

        Parameters
        ----------
        model
            The model, with its effects.
        free
            Further free parameters, by full name.
        start
            Values to start from, by full name; else those of `like`, else the model's.
        like
            A fit of a simpler model, whose parameters and initial state are the start.
        bounds
            Narrower ranges by full name: an onset inside the record.
        rounds
            How often the noise model is fitted again.
        steps
            Most steps for one noise model.
        shrink
            Free parameters that start from smaller values than given where these are nearer to the record.
        noise
            Noise model to begin with, where the start is near the end; else white noise that is large.

        Returns
        -------
        Fit or None
            None when the model can not simulate the record from the start values.
        """
        unknowns = Unknowns(self.problem, model, free, start or {}, like, bounds or {})
        descent = Descent(self.problem, self.rows, model, unknowns)
        if shrink:
            descent.shrink(shrink)
        return descent.run(rounds, steps, like is None, noise)

    def settled(self, fit: Fit, bounds: Mapping[str, tuple[float, float]] | None = None, least: float = SETTLED) -> Fit:
        """The fit started again from where it ended until that gains less than `least`.

        Coloured noise explains a slow misfit away, and a search may rest there; each start is with white noise again.
        """
        for _ in range(MOST_RESTARTS):
            if self.problem.time_is_up:
                return fit
            again = self.fit(fit.model, fit.names, like=fit, bounds=bounds, rounds=2)
            if again is None or again.loss > fit.loss - least:
                return fit
            fit = again
        return fit

    def at_its_constants(self, fit: Fit, bounds: Mapping[str, tuple[float, float]] | None = None) -> Fit:
        """The fit along a model that has the constants which it came to, again until they stay.

        Another alternative comes to other constants than those for which the responses were worked out. The run is then
        exact, and only its derivatives are those of a neighbour.
        """
        background = self.problem.background
        moves = background is not None and (background.sites or background.told)
        for _ in range(MOST_RESTARTS if moves else 0):
            own = at_its_constants(self.problem, fit)
            again = self.fit(own.model, own.names, like=own, bounds=bounds, rounds=2)
            if again is None:
                return fit
            stays = abs(again.loss - fit.loss) < SETTLED
            fit = again
            if stays or self.problem.time_is_up:
                return fit
        return fit

    def with_intervals(self, fit: Fit) -> Fit:
        """The fit with the covariance of exact derivatives: those that a search ends with may be a few steps old."""
        return self.fit(fit.model, fit.names, like=fit, rounds=0) or fit
