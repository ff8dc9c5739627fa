"""One way to score and fit a candidate."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.discovery.candidates.responses import TimeProfile
from adaptive_flot.greybox.effects import Effect


@dataclass(frozen=True)
class Variant:
    """One way to score and fit a candidate.

    Attributes
    ----------
    effect
        The effect at amplitude zero, with its settings, and shapes that every fit holds.
    profiles
        Profiles at the site (r of them) whose linear combination it is near amplitude zero.
    coefficients
        Coefficient that each profile is the derivative of; "" where there is none (see `start`).
    start
        Further values to start a fit from (onset, time constant).
    """

    effect: Effect
    profiles: tuple[TimeProfile, ...]
    coefficients: tuple[str, ...]
    start: tuple[tuple[str, float], ...] = ()
