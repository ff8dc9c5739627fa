"""The test that would tell alternatives apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray

WATCHING = "no move"

Names = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Pair:
    """Two alternatives by their names, and what a test would separate them by."""

    one: Names
    other: Names
    separation: float


@dataclass(frozen=True)
class Tried:
    """A test in words, and the separation of its closest pair."""

    name: str
    separation: float


@dataclass(frozen=True)
class Experiment:
    """A test that would tell alternatives apart, if any of those tried does.

    Attributes
    ----------
    name
        The test in words.
    dt
        Length of an interval [s].
    inputs
        Inputs (N, nu) held in each interval.
    quantities
        Name and unit of each input.
    predicted
        Outputs (N, m) that each compared alternative predicts, in their order.
    compared
        The alternatives by their names.
    noise
        Standard deviation of the noise of each output (m,).
    pairs
        Separation of every pair, the closest first.
    tried
        Every test, best first; "no move" is what watching alone would tell.
    needed
        Separation from which the verdict would tell two apart.
    """

    name: str
    dt: float
    inputs: FloatArray
    quantities: tuple[tuple[str, str], ...]
    predicted: tuple[FloatArray, ...]
    compared: tuple[Names, ...]
    noise: FloatArray
    pairs: tuple[Pair, ...]
    tried: tuple[Tried, ...]
    needed: float

    @property
    def tells(self) -> bool:
        """Whether it separates every pair by more than the verdict needs."""
        return self.pairs[0].separation >= self.needed

    def moves(self) -> list[tuple[float, FloatArray]]:
        """(time since the start of the test [s], inputs (nu,) from then on) of each move."""
        changed = np.flatnonzero(np.any(np.diff(self.inputs, axis=0) != 0, axis=1)) + 1
        return [(float(k * self.dt), self.inputs[k]) for k in (0, *changed)]

    def __str__(self) -> str:
        closest = self.pairs[0]
        said = "A test that would tell" if self.tells else "No test tried would tell them all apart; the best"
        said += f": {self.name}, {self.dt * len(self.inputs):g} s"
        return (
            f"{said}. The closest two, {_words(closest.one)} and {_words(closest.other)}, would then differ by about "
            f"{closest.separation:.0f} in their criterion; {self.needed:.0f} is the least that tells two apart, and "
            f"watching without a move would give {self.watching:.0f}."
        )

    @property
    def watching(self) -> float:
        """Separation of the closest pair when nothing is moved."""
        return next((t.separation for t in self.tried if t.name == WATCHING), float("nan"))

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""
        names = [f"{name} [{unit}]" for name, unit in self.quantities]

        def pairs(alternative: Names) -> list[dict[str, str]]:
            return [{"site": s, "driver": d} for s, d in alternative]

        return {
            "test": self.name,
            "duration_s": self.dt * len(self.inputs),
            "tells_apart": self.tells,
            "separation_needed": round(self.needed, 1),
            "moves": [{"time_s": t, **{n: float(v) for n, v in zip(names, u, strict=True)}} for t, u in self.moves()],
            "pairs": [
                {"one": pairs(p.one), "other": pairs(p.other), "separation": round(p.separation, 1)} for p in self.pairs
            ],
            "tried": [{"test": t.name, "separation_of_closest": round(t.separation, 1)} for t in self.tried],
        }


def _words(names: Names) -> str:
    return " with ".join(f"{site} by {driver}" for site, driver in names)
