"""The words of a verdict, and how many parts a class may have."""

from __future__ import annotations

from typing import Literal

Word = Literal["none", "named", "class", "unnamed", "insufficient", "abstain"]

WITH_A_NAME: tuple[Word, ...] = ("named", "class")
"""Words that give a name, or one of a few."""
TELLING: tuple[Word, ...] = (*WITH_A_NAME, "unnamed")
"""Words that tell an effect, with or without its name."""
LARGEST_CLASS = 3
"""Most members of a class for each effect: more say too little."""
NORMAL95 = 1.96
"""Standard deviations on either side of an estimate that hold 95 % of a normal distribution."""
ONE_CAUSE = "One cause that acts at several places looks like that, and the catalogue has none"
"""Why several changes with one course are not told."""
NO_SITE = "the model has no site for that"
"""What is said of something that acts where the model has no site,"""
NOTHING_ADDED = "Before and after are alike: what acts there has no site, so that nothing was added to the model."
"""and of its errors."""
DRIFTS = "Something changes with time."
"""How the reason of an abstention begins where a constant drifts far that the model does not say to drift."""


def in_seconds(period: float) -> str:
    """A period as it is read: `3990`, `12.4`."""
    return f"{period:.0f}" if period >= 100 else f"{period:.3g}"


def short(value: float) -> str:
    """A number as it is read: three digits, and no power of ten below a million (`1140`, not `1.14e+03`)."""
    return _plain(f"{value:.3g}")


def rough(value: float) -> str:
    """The same with two digits.

    >>> rough(168.0), rough(1.04), rough(2.3e7)
    ('170', '1', '2.3e+07')
    """
    return _plain(f"{value:.2g}")


def _plain(digits: str) -> str:
    return f"{float(digits):.0f}" if "e+" in digits and abs(float(digits)) < 1e6 else digits
