"""The smallest change at a site that a record shows: what `none` does not rule out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.discovery.results.words import rough, short

FALLS_BY = 0.5
"""A value that may fall by more than this share without being seen is told by itself."""


@dataclass(frozen=True)
class LeastShown:
    """The smallest change at a site that a record shows.

    Attributes
    ----------
    site
        Name of the site.
    by_factor
        Whether its value changes by a factor, else by an amount.
    size
        Share by which the value falls, or the amount in the site's unit; infinite where nothing shows.
    unit
        Unit of an amount.
    """

    site: str
    by_factor: bool
    size: float
    unit: str

    @property
    def hidden(self) -> bool:
        """Whether even a value that falls by half, or any amount, stays unseen."""
        return not np.isfinite(self.size) or (self.by_factor and self.size > FALLS_BY)

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""
        size = self.size if np.isfinite(self.size) else None
        kind = {"falls_by": size} if self.by_factor else {"moves_by": size, "unit": self.unit}
        return {"site": self.site, **kind}

    @property
    def size_text(self) -> str:
        """The size with its unit; that not even half shows, or nothing."""
        if self.hidden:
            return "not by half" if self.by_factor else "nothing"
        return f"{rough(100 * self.size)} %" if self.by_factor else f"{short(self.size)} {self.unit}".rstrip(" -")

    def __str__(self) -> str:
        return f"{self.site.replace('_', ' ')} {self.size_text}"


def what_is_shown(found: Sequence[LeastShown]) -> tuple[str, ...]:
    """From what size on a record shows a change, in words, as a note; none where it shows nothing."""
    shown = ", ".join(str(s) for s in found if not s.hidden)
    return (f"A change that lasts from halfway on would have shown from about this size: {shown}.",) if shown else ()


def what_is_hidden(found: Sequence[LeastShown]) -> str:
    """Where the record shows next to nothing, in words; empty where it shows all."""
    hidden = ", ".join(s.site.replace("_", " ") for s in found if s.hidden)
    return f"The record says little of {hidden}: not even a fall by half would have shown." if hidden else ""
