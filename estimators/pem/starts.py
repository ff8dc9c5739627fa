"""Scattered starts of a search, the same on every machine."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from estimators.pem.problem import Problem

SPREAD = 0.7
"""Standard deviation of the logarithm of a positive unknown: a factor of two, often."""
SCALES = 3.0
"""Standard deviation of any other unknown, in its scale."""


def scattered(problem: Problem, count: int) -> list[FloatArray]:
    """Starts (unknowns,) around the centre of a problem, `count` of them, inside its range.

    What is positive by its range is multiplied by exp(SPREAD g), anything else moved by SCALES g scales; g is standard
    normal, pseudo-random with seed k: start k is the same on every machine.
    """
    lowest = problem.centre + problem.scale * problem.lower
    positive = (lowest >= 0) & (problem.centre > 0)
    starts = []
    for k in range(count):
        g = np.random.default_rng(k).standard_normal(len(problem.centre))
        values = np.where(positive, problem.centre * np.exp(SPREAD * g), problem.centre + SCALES * g * problem.scale)
        starts.append(np.clip((values - problem.centre) / problem.scale, problem.lower, problem.upper))
    return starts
