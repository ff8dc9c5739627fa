"""Effects that explain a record together, and what they are worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.filter.refit import Refit

LEAST_GAIN = 12.0
"""Gain of the criterion that another effect must bring."""


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


def worth(explanation: Explanation) -> float:
    """The criterion, less what each effect must gain: two effects stand for one only where they explain so much more.

    The criterion charges numbers. That two things are wrong at a time is less likely than that one is.
    """
    return explanation.criterion - LEAST_GAIN * len(explanation.hypotheses)


def numbers_of(h: Hypothesis) -> int:
    """How many numbers a hypothesis was fitted by, those taken from a grid and the times of a switch too."""
    told = h.effect.coefficients.items() if h.kind in (*EVENTS, "cycle") else ()
    times = [c for c, v in told if c.startswith(("on_", "for_", "onset", "duration", "period")) and v < FOREVER]
    return len(h.free) + len(times)


def distinct(found: Sequence[Explanation]) -> list[Explanation]:
    """The best of each set of effects, the best first."""
    kept: dict[frozenset[tuple[str, str, str]], Explanation] = {}
    for e in sorted(found, key=lambda e: -e.criterion):
        kept.setdefault(e.names, e)
    return list(kept.values())
