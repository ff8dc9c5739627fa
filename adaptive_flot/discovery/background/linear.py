"""Linear responses of a background along a run: to the lines of a course, and to each uncertain constant."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.candidates.responses import Responses, TimeProfile
from adaptive_flot.discovery.record.background import knots_of_course, lines_between
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.greybox.model import FloatArray

MOST_KNOTS, LEAST_ROWS = 96, 4
"""Knots of a course, and the least rows between them."""
UNCERTAIN_ROLES = ("process", "flow")
"""Roles of the sites whose constants are known to some per cent only. What is wrong with a sensor, an actuator or a
feed is a fault, which has a name."""


def feeds_unseen(problem: Problem, responses: Responses) -> tuple[str, ...]:
    """Sites of role feed whose value no input measures: such a feed may wander unseen."""
    sites = responses.fit.model.sites
    return tuple(s.name for s in sites if s.role == "feed" and not _measured(problem, responses, s.name))


def _measured(problem: Problem, responses: Responses, site: str) -> bool:
    """Whether the value at a site is an input of the record: it may be wrong, but it does not wander unseen."""
    value = responses.site_values[site]
    return any(np.allclose(value, u, rtol=1e-9, atol=0.0) for u in problem.record.inputs.T)


def uncertain_constants(responses: Responses) -> tuple[str, ...]:
    """Sites whose value is known to some per cent only: quantities of the process that no free parameter scales."""
    adapted = responses.adapted_sites()
    sites = responses.fit.model.sites
    return tuple(s.name for s in sites if s.role in UNCERTAIN_ROLES and s.mode == "factor" and s.name not in adapted)


def lines_of_course(problem: Problem, site: str, offset: bool) -> tuple[FloatArray, list[TimeProfile]]:
    """Knots (k,) of a course at a site, and its lines between them."""
    time = problem.record.time
    knots = knots_of_course(time, MOST_KNOTS, LEAST_ROWS)
    return knots, [TimeProfile(site, line, offset) for line in lines_between(time, knots).T]


def uncertain_profiles(problem: Problem, responses: Responses) -> list[TimeProfile]:
    """A constant change of the logarithm of the value at each of `uncertain_constants`."""
    ones = np.ones(len(problem.record))
    return [TimeProfile(site, ones, False) for site in uncertain_constants(responses)]
