"""How large a lasting change at a site has to be for a record to show it: what `none` does not rule out.

With the response r of the innovations to a change of one unit from halfway on, in standard deviations, and what the
free constants and what is known of them leave of it, r', the information of the record on its size is r'r'. A change is
looked at where it gains the log-likelihood G. In four of five records it does from this size on::

    d = (sqrt(2 G) + z_0.8) / sqrt(r'r')         G = LEAST_GAIN + log n

The two numbers of a change, its size and its time, cost log n of the n rows. Willsky & Jones, *IEEE Trans. Automatic
Control* 21 (1976) 108, equations 21 and 22: the test of a jump of unknown time; the rest is the power of a test by a
normal variable.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.filter.refit import Refit, Refitter
from adaptive_flot.discovery.innovations.filter.thinning import searchable
from adaptive_flot.discovery.innovations.screening import span
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN
from adaptive_flot.discovery.results import LeastShown, State
from adaptive_flot.greybox.model import FloatArray

POWER = 0.8
"""Share of records in which a change of the size that is told would be looked at."""


def tell_least_shown(state: State) -> State:
    """Say of a record that the model explains how small a change it would have shown.

    The noise is fitted at the constants that the free run has. Nothing is said of a record that is too long.
    """
    problem, (before, _) = state.known_problem, state.refitted
    if state.judged.word != "none" or time.monotonic() > state.ends:
        return state
    record = searchable(replace(problem.record, initial_state=before.initial_state), before.model)
    if record is None:
        return state
    floor = noise_floor([problem.record], problem.columns)
    fitter = Refitter(before.model, record, problem.columns, floor, problem.adapted)
    with np.errstate(all="ignore"):
        return replace(state, least_shown=least_shown(fitter, fitter.at(before.model.parameter_values)))


def least_shown(fitter: Refitter, fit: Refit) -> tuple[LeastShown, ...]:
    """The smallest change from halfway on that the record shows, for each site of the model.

    Parameters
    ----------
    fitter
        The fits of the model as it is.
    fit
        One of them.
    """
    model = fitter.model
    response = fitter.response(fit, [s.name for s in model.sites])
    slopes, _ = fitter.space.known_rows(fit.p)
    constants = np.vstack([response.by_constants, slopes])
    n = max(int(np.count_nonzero(response.innovations)), 2)
    reach = np.sqrt(2 * (LEAST_GAIN + np.log(n))) + norm.ppf(POWER)
    values, _ = response.seen()
    found = []
    for site in model.sites:
        by_factor = site.mode == "factor"
        course = values[site.name] if by_factor else np.ones(len(fitter.record) - 1)
        later = np.arange(len(course)) >= len(course) // 2
        moved = response.respond(site.name, (course * later)[:, None])[:, 0]
        size = reach / np.sqrt(_left(constants, np.concatenate([moved, np.zeros(len(slopes))])))
        found.append(LeastShown(site.name, by_factor, float(-np.expm1(-size) if by_factor else size), site.unit or ""))
    return tuple(found)


def _left(constants: FloatArray, response: FloatArray) -> float:
    """Squared length of what a fit of the constants can not explain of a response; tiny where that is all of it."""
    if not (np.isfinite(response).all() and np.isfinite(constants).all()):
        return 1e-300
    basis, whole = span(constants), float(response @ response)
    rest = response - basis @ (basis.T @ response)
    return max(float(rest @ rest) - 1e-12 * whole, 1e-300)
