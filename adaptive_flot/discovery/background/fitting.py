"""The fit that has a background, and whether a fit needs it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from adaptive_flot.discovery.assessment.likelihood import LEAST_EVIDENCE
from adaptive_flot.discovery.background.evidence import Evidence, Spread, price
from adaptive_flot.discovery.background.linear import (
    lines_of_course,
    uncertain_constants,
    uncertain_profiles,
)
from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter, at_its_constants
from adaptive_flot.discovery.record.background import Background, root_of_covariance
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.search.rounds import scorer_of
from adaptive_flot.greybox.rescaled import as_it_came, factors_of, rescaled

RELINEARISED = 2
"""How often a background is fitted to be linearised anew."""


def fit_with_background(
    problem: Problem, spread: Spread, base: Fit, responses: Responses, turns: int = RELINEARISED
) -> tuple[Problem, Fit] | None:
    """The problem with a background, and its fit, linearised where that fit is; None when it can not be simulated.

    First along the base fit. Then once more, along a model that has the constants which were found: what is ten per
    cent off is not linear.

    Parameters
    ----------
    problem, base, responses
        The record, the fit without a background, and the responses along it.
    spread
        The numbers of the background.
    turns
        How often it is fitted to be linearised anew.
    """
    for _ in range(turns):
        problem = replace(problem, background=background_of(problem, spread, responses))
        fitted = Fitter(problem).fit(base.model, base.names, like=base, rounds=2)
        if fitted is None:
            return None
        base = at_its_constants(problem, fitted)
        responses = Responses(problem, base)
    problem = replace(problem, background=background_of(problem, spread, responses))
    again = Fitter(problem).fit(base.model, base.names, like=base, rounds=2)
    return None if again is None else (problem, again)


def spread_along(problem: Problem, beside: Problem, fit: Fit, feeds: Sequence[str]) -> Spread:
    """The numbers of a background once more, along a fit that has it: far from there the responses say little.

    The noise is that of this fit. Without a background, what wanders and what is off would count as coloured noise,
    and hide the smaller part of the background: the constants beside a course, or a course beside the constants.

    Parameters
    ----------
    problem
        The record without a background.
    beside, fit
        The same with one, and a fit that has it.
    feeds
        Sites at which a course is tried.
    """
    own = at_its_constants(beside, fit)
    there = Fitter(beside).fit(own.model, own.names, like=own, rounds=2) or fit
    bare = without_background(beside, there)
    responses = Responses(problem, bare)
    evidence = Evidence(problem, scorer_of(problem, bare, responses, there.noise)[0], responses, feeds)
    return evidence.but_for_what_stands_out(evidence.best)


def without_background(problem: Problem, fit: Fit) -> Fit:
    """A fit beside a background, which is taken off: the run of its model with the constants that this has."""
    background = problem.background
    assert background is not None  # asked of a fit that has one
    added = background.outputs(fit.background, fit.model)
    return replace(fit, predicted=fit.predicted - added, background=np.zeros(0))


def taken_up(problem: Problem, sites: Collection[str]) -> bool:
    """Whether the background has constants at some of these sites: it may take up what is told of them."""
    return problem.background is not None and not set(sites).isdisjoint(problem.background.sites)


def without_constants(problem: Problem, fit: Fit, sites: Collection[str]) -> tuple[Problem, Fit]:
    """A problem and a fit whose background leaves the constants at some sites as they came.

    A constant that is named is part of the background as well, which takes up some of it. Without that, the effect has
    its whole size, and an interval that counts it once.

    Parameters
    ----------
    problem, fit
        The record with its background, and a fit.
    sites
        Whose constants stay as they came; both come back unchanged where the background has none of them.
    """
    background = problem.background
    if background is None or not taken_up(problem, sites):
        return problem, fit
    spread = Spread(background.course, background.constants, 0.0, told=background.told)
    plain = replace(problem, background=None)
    own = {s: f for s, f in factors_of(fit.model).items() if s not in sites}
    fit, beside = replace(fit, model=rescaled(fit.model, own)), problem
    for _ in range(RELINEARISED):
        beside = replace(problem, background=background_of(plain, spread, Responses(plain, fit)).holding(sites))
        again = Fitter(beside).fit(fit.model, fit.names, like=fit, rounds=2)
        if again is None:
            break
        fit = at_its_constants(beside, again)
    return beside, fit


def with_course_told(problem: Problem, fit: Fit) -> Fit:
    """The fit whose model has the told course that it came to, with the covariance of its values at the knots.

    With the covariance S of its u, and std L of `Course.root`, that of the values is std L S L' std. Unchanged where
    no course is told.
    """
    background = problem.background
    if background is None or background.told is None:
        return fit
    model, told = background.at_its_values(fit.background, fit.model), background.told
    root, names = told.root(model), told.parameters_in(model)
    own = root @ fit.background_covariance[: len(root), : len(root)] @ root.T
    return replace(
        fit, model=model, names=(*fit.names, *names), values=np.concatenate([fit.values, told.values_in(model)]),
        covariance=block_diag(fit.covariance, own),
    )  # fmt: skip


def background_of(problem: Problem, spread: Spread, responses: Responses) -> Background:
    """The background, with its responses along the fit of these `responses`."""
    parts = []
    for course in (spread.told, spread.course):
        if course is not None:
            knots, lines = lines_of_course(problem, course.site, course.offset)
            parts.append(responses.of(lines) @ (course.std * root_of_covariance(knots, course.time)))
    if spread.constants:
        parts.append(spread.constants * responses.of(uncertain_profiles(problem, responses)))
    sites = uncertain_constants(responses) if spread.constants else ()
    return Background(spread.course, spread.constants, np.concatenate(parts, axis=2), sites, spread.told)


def needed(problem: Problem, fit: Fit) -> bool:
    """Whether a fit with the background is better than the same without, by more than the price of its numbers."""
    plain = Fitter(replace(problem, background=None)).fit(as_it_came(fit.model), fit.names, like=fit, rounds=2)
    return plain is None or plain.loss - fit.loss > 2 * price(problem) + LEAST_EVIDENCE
