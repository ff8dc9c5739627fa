"""Hypotheses fitted to some stretches of the records and judged on the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.joint.fit import MOST_EVALUATIONS, JointFit, JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants, at_rest, first_states
from adaptive_flot.discovery.hypotheses.joint.rows import TAIL, BoolArray, Rows
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter

FOLDS = 5
"""Stretches of a record that are left out in turn."""
REFINED = 2
"""Starts of a hypothesis that are refined."""
REFRESH = 5
"""Evaluations between new derivatives by constants and initial states, where a reference tells the constants."""


NEAR = 0.4
"""Share of the best gain on the fitted rows from which on a hypothesis is tested on fresh ones."""
MOST_TESTED = 12
FIRST_EVALUATIONS = 8
"""Most evaluations of the derivatives of a first fit, that only says which hypotheses are near."""
FOLD_EVALUATIONS = 6
"""Most evaluations of the derivatives where a stretch is left out: the fit to all rows is near."""


@dataclass(frozen=True)
class Fitted:
    """A hypothesis (None: the model as it is), fitted to all rows."""

    hypothesis: Hypothesis | None
    constants: Constants
    initial: tuple[FloatArray, ...]
    fit: JointFit


@dataclass(frozen=True)
class Tested:
    """A hypothesis (None: the model as it is), fitted to all rows, and its errors on rows that did not fit it.

    Attributes
    ----------
    hypothesis
        What was added.
    fit
        Fit to all rows that count.
    fresh
        Errors of each record (N, m): every row by a fit that did not see its stretch.
    losses
        Criterion of each row and output of these (N, m), a record.
    values
        Fitted coefficients of each fold (folds, coefficients).
    prior
        What it costs that constants and initial states are where they are.
    deviations
        Standard deviations of the coefficients by the fit to all rows (coefficients,), see `JointFitter.deviations`.
    """

    hypothesis: Hypothesis | None
    fit: JointFit
    fresh: tuple[FloatArray, ...]
    losses: tuple[FloatArray, ...]
    values: FloatArray
    prior: float
    deviations: FloatArray

    @property
    def spread(self) -> FloatArray:
        """Standard deviations of the coefficients: by the jackknife over folds, and at least those of the fit.

        With a value v_k of each of K folds, each without its stretch (Efron & Tibshirani, *An Introduction to the
        Bootstrap*, 1993, 11.5)::

            s^2 = (K - 1) / K sum_k (v_k - mean v)^2

        What was found on all rows starts each fold, and a fit that is hardly off does not move.
        """
        jackknife = np.sqrt((len(self.values) - 1) * np.var(self.values, axis=0))
        found: FloatArray = np.maximum(jackknife, self.deviations)
        return found

    @property
    def total(self) -> float:
        """Criterion over all rows, each judged by a fit that did not see it, and the priors."""
        return float(sum(loss.sum() for loss in self.losses)) + self.prior

    def moved(self, constants: int) -> float:
        """The part of the prior that so many constants cost: how far they are from what is known, chi-squared."""
        first = len(self.fit.coefficients)
        return float(np.sum(self.fit.unknowns[first : first + constants] ** 2))


def stretches(rows: Rows, folds: int = FOLDS) -> list[tuple[BoolArray, ...]]:
    """Masks of the rows left out in each fold: one contiguous part of every record, another one from record to record.

    A record is never left out as a whole: nothing would say where it starts.
    """
    left_out = []
    for k in range(folds):
        masks = []
        for i, record in enumerate(rows.records):
            edges = np.linspace(0, len(record), folds + 1).round().astype(int)
            part = (k + i) % folds
            mask = np.zeros(len(record), dtype=bool)
            mask[edges[part] : edges[part + 1]] = True
            masks.append(mask)
        left_out.append(tuple(masks))
    return left_out


def fit_all_rows(
    model: Model,
    rows: Rows,
    hypothesis: Hypothesis | None,
    constants: Constants,
    base: JointFit | None,
    *,
    refresh: int = REFRESH,
    elsewhere: Sequence[FloatArray] = (),
) -> Fitted | None:
    """Fit a hypothesis to all rows that count; None where it can not be simulated.

    Parameters
    ----------
    model
        The model without the hypothesis.
    rows
        Records and rows.
    hypothesis
        What to add; None for the model as it is.
    constants
        Constants that are fitted with it, and what is known of them.
    base
        Fit of the model as it is, with the same constants, to start from.
    refresh
        See `JointFitter.fit`.
    elsewhere
        Further constants (c,) to start from, in units of their prior.
    """
    extended = model_with(model, hypothesis)
    own = hypothesis.parameters if hypothesis else ()
    initial = with_effect_states(extended, first_states(model, rows.records), rows.records)
    fitter = JointFitter(extended, rows, constants, own, initial)
    fit = (
        fitter.fit_from_afar(fitter.unknowns.start())
        if hypothesis is None or base is None
        else _first_fit(fitter, hypothesis, base, refresh, elsewhere)
    )
    return None if fit is None else Fitted(hypothesis, constants, tuple(initial), fit)


def worth_testing(base: Fitted, fitted: Sequence[Fitted]) -> tuple[Fitted, ...]:
    """Hypotheses whose gain on the rows that fitted them comes near to the best one's, best first."""
    ranked = sorted(fitted, key=lambda f: f.fit.cost)
    if not ranked:
        return ()
    least = NEAR * (base.fit.cost - ranked[0].fit.cost)
    return tuple(f for f in ranked if base.fit.cost - f.fit.cost >= least)[:MOST_TESTED]


def test_on_stretches(model: Model, rows: Rows, fitted: Fitted, *, hold_constants: bool, folds: int = FOLDS) -> Tested:
    """Judge a fitted hypothesis: fit it anew to all but each stretch, and keep its errors there.

    Parameters
    ----------
    model
        The model without the hypothesis.
    rows
        Records and rows.
    fitted
        The hypothesis.
    hold_constants
        Whether constants and initial states stay as they were fitted to all rows. With a reference they should: every
        hypothesis and the model as it is have the same freedom in them, and what is asked is whether the coefficients
        found on some rows hold on others.
    folds
        Stretches.
    """
    whole, own, extended = fitted.fit, fitted.fit.coefficients, model_with(model, fitted.hypothesis)
    fresh = [np.full(e.shape, np.nan) for e in whole.errors]
    values = []
    fitter = JointFitter(extended, rows, fitted.constants, own, fitted.initial)
    for left_out in stretches(rows, folds):
        part = (
            _fitted_elsewhere(fitter.on(rows.without(left_out)), whole, hold_constants)
            if own or not hold_constants
            else whole
        )
        values.append([part.value(name) for name in own])
        for target, theirs, mask in zip(fresh, part.errors, left_out, strict=True):
            target[mask] = theirs[mask]
    prior = float(np.sum(fitter.prior(whole.unknowns) ** 2))
    deviations = fitter.deviations(whole)
    return Tested(fitted.hypothesis, whole, tuple(fresh), rows.losses(fresh), np.array(values), prior, deviations)


def _fitted_elsewhere(fitter: JointFitter, whole: JointFit, hold_constants: bool) -> JointFit:
    if hold_constants:
        return fitter.fit_coefficients(whole.unknowns, most=FOLD_EVALUATIONS)
    start = fitter.unknowns.inside(whole.unknowns + _step(fitter, whole))
    return fitter.fit(start, most=FOLD_EVALUATIONS, shared=_masked(fitter, whole))


def _masked(fitter: JointFitter, whole: JointFit) -> FloatArray:
    """Derivatives of the fit to all rows by constants and initial states, nothing where a row is left out."""
    there = np.concatenate([fitter.rows.there(i).ravel() for i in range(len(whole.errors))])
    slopes = whole.jacobian[:, len(whole.coefficients) :].copy()
    slopes[: len(there)] *= there[:, None]
    return slopes


def _step(fitter: JointFitter, whole: JointFit) -> FloatArray:
    """One step of Gauss and Newton from the fit to all rows to that to some, with the weights of Student's t.

    ::

        w = 1 / (1 + e^2 / (nu s^2))
    """
    J, rows, prior = whole.jacobian, fitter.rows, fitter.prior(whole.unknowns)
    r = np.concatenate([rows.scaled(i, e).ravel() for i, e in enumerate(whole.errors)])
    there = np.concatenate([rows.there(i).ravel() for i in range(len(whole.errors))])
    w = np.concatenate([there / (fitter.memory * (1 + r**2 / TAIL)), np.ones(len(prior))])
    weighted = J * w[:, None]
    step: FloatArray = -np.linalg.lstsq(weighted.T @ J, weighted.T @ np.concatenate([r, prior]), rcond=1e-10)[0]
    return step


def model_with(model: Model, hypothesis: Hypothesis | None) -> Model:
    """Return the model with a hypothesis, its coefficients with its own limits and scales."""
    if hypothesis is None:
        return model
    extended = model.with_effects([hypothesis.effect])
    limits = {hypothesis.effect.parameter(c): ends for c, ends in hypothesis.limits.items()}
    scales = {hypothesis.effect.parameter(c): scale for c, scale in hypothesis.scales.items() if scale > 0}
    if not limits and not scales:
        return extended

    def own(p: Parameter) -> Parameter:
        low, high = limits.get(p.name, (p.lower, p.upper))
        return replace(p, lower=max(p.lower, low), upper=min(p.upper, high), scale=scales.get(p.name, p.scale))

    return replace(extended, parameters=tuple(map(own, extended.parameters)))


def _first_fit(
    fitter: JointFitter,
    hypothesis: Hypothesis,
    base: JointFit,
    refresh: int,
    elsewhere: Sequence[FloatArray],
) -> JointFit | None:
    """A first fit from the best few starts; with a reference, derivatives by the constants are those of the base.

    Without one, constants are unknown, and those of the model as it is may be far off: every set of them that is
    given `elsewhere` is refined too.
    """
    shared = fitter.shared_slopes(base) if refresh > 1 else None
    most = FIRST_EVALUATIONS if refresh > 1 else MOST_EVALUATIONS
    chosen: list[FloatArray] = []
    for constants, count in ((None, REFINED), *((c, 1) for c in elsewhere)):
        tried: list[tuple[float, int, FloatArray]] = []
        for k, start in enumerate(hypothesis.starts):
            z = fitter.unknowns.inside(
                fitter.extended(base, {hypothesis.effect.parameter(c): v for c, v in start.items()})
            )
            if constants is not None:
                z[len(fitter.coefficients) : len(fitter.coefficients) + len(constants)] = constants
            cost = fitter.cost(z, fitter.errors(z))
            if np.isfinite(cost):
                tried.append((cost, k, z))
        chosen += [z for _, _, z in sorted(tried, key=lambda t: t[:2])[:count]]
    fits = [fitter.fit(z, most=most, refresh=refresh, shared=shared) for z in chosen]
    fits = [f for f in fits if np.isfinite(f.cost)]
    return min(fits, key=lambda f: f.cost) if fits else None


def refined(model: Model, rows: Rows, first: Fitted, refresh: int = REFRESH) -> Fitted:
    """The same hypothesis, fitted on from its first fit with derivatives of its own."""
    own = first.fit.coefficients
    fitter = JointFitter(model_with(model, first.hypothesis), rows, first.constants, own, first.initial)
    fit = fitter.fit(first.fit.unknowns, refresh=refresh)
    return replace(first, fit=fit) if fit.cost <= first.fit.cost else first


def fitted_and_tested(
    model: Model, rows: Rows, hypothesis: Hypothesis, constants: Constants, base: JointFit
) -> Tested | None:
    """A hypothesis since a reference, fitted with its own derivatives and judged on stretches; None if it has no run.

    Arguments are those of `fit_all_rows`. Constants stay as they are on all rows, see `test_on_stretches`.
    """
    fitted = fit_all_rows(model, rows, hypothesis, constants, base)
    return None if fitted is None else test_on_stretches(model, rows, refined(model, rows, fitted), hold_constants=True)


def with_effect_states(
    model: Model, initial: Sequence[FloatArray], records: Sequence[Dataset]
) -> tuple[FloatArray, ...]:
    """Initial states (nx,) with those of the effect behind: a lag starts where it follows, a store at rest."""
    together = (np.concatenate([x, np.ones(len(model.states) - len(x))]) for x in initial)
    return tuple(at_rest(model, x, record) for x, record in zip(together, records, strict=True))
