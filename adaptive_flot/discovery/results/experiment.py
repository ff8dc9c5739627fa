"""The test that would tell alternatives apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.greybox.model import FloatArray

WATCHING = "no move"

ENOUGH = 0.8
"""Share of simulated tests that must tell the truth for a test to be worth its price."""
LISTED, HARDLY = 4, 0.05
"""Alternatives that are always listed; of more, those that are told in fewer tests than this share count together."""

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
    power
        Share of simulated tests in which each compared alternative, if it is the truth, is told from all others.
    held
        Inputs that the test leaves alone, and why.
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
    power: tuple[float, ...]
    held: tuple[tuple[str, str], ...] = ()

    @property
    def tells(self) -> bool:
        """Whether, whichever alternative is the truth, it is told in most simulated tests."""
        return min(self.power) >= ENOUGH

    def moves(self) -> list[tuple[float, FloatArray]]:
        """(time since the start of the test [s], inputs (nu,) from then on) of each move."""
        changed = np.flatnonzero(np.any(np.diff(self.inputs, axis=0) != 0, axis=1)) + 1
        return [(float(k * self.dt), self.inputs[k]) for k in (0, *changed)]

    def __str__(self) -> str:
        closest, shared = self.pairs[0], _shared(self.compared)
        compared = [_without(n, shared) for n in self.compared]
        said = "A test that would tell" if self.tells else "No test tried would tell them all apart; the best"
        said += f": {self.name}, {self.dt * len(self.inputs):g} s"
        beside = f" All have {_words(shared)}, beside what is listed." if shared else ""
        told = _powers(compared, self.power)
        alone = f" Left alone: {', '.join(f'{n} ({why})' for n, why in self.held)}." if self.held else ""
        pair = " and ".join(_words(_without(n, shared)) for n in (closest.one, closest.other))
        known = np.isfinite(self.watching)
        watched = f" Watching without a move would give {self.watching:.0f}." if known else ""
        if max(self.power) < HARDLY:
            each = ", or ".join(map(_words, compared))
            length, apart = self.dt * len(self.inputs), closest.separation
            return (
                f"No test tried would tell any of these apart: {each}.{beside} With the best, {self.name}, "
                f"{length:g} s, the closest two would differ by about {apart:.0f} in their criterion, where "
                f"{self.needed:.0f} is needed.{alone}"
            )
        return (
            f"{said}.{beside} Simulated with each alternative as the truth, it tells the right one: {told}. The "
            f"closest two, {pair}, would differ by about {closest.separation:.0f} in their criterion, where "
            f"{self.needed:.0f} is needed.{watched}{alone}"
        )

    @property
    def watching(self) -> float:
        """Separation of the closest pair when nothing is moved; NaN where that could not be simulated."""
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
            "power": [{"true": pairs(n), "told": round(p, 3)} for n, p in zip(self.compared, self.power, strict=True)],
            "left_alone": dict(self.held),
            "separation_needed": round(self.needed, 1),
            "moves": [{"time_s": t, **{n: float(v) for n, v in zip(names, u, strict=True)}} for t, u in self.moves()],
            "pairs": [
                {"one": pairs(p.one), "other": pairs(p.other), "separation": round(p.separation, 1)} for p in self.pairs
            ],
            "tried": [{"test": t.name, "separation_of_closest": round(t.separation, 1)} for t in self.tried],
        }


def _powers(compared: Sequence[Names], power: Sequence[float]) -> str:
    """How often each alternative is told; of many, those that are told at all, and the rest in one."""
    each = [(f"{_words(n)} in {100 * p:.0f} %", p) for n, p in zip(compared, power, strict=True)]
    hardly = [p for _, p in each if p < HARDLY]
    if len(each) <= LISTED or len(hardly) < 2:
        return ", ".join(words for words, _ in each)
    rest = f"{'each of the other' if len(hardly) < len(each) else 'each of all'} {len(hardly)}"
    return ", ".join([words for words, p in each if p >= HARDLY] + [f"{rest} in at most {100 * max(hardly):.0f} %"])


def _shared(compared: Sequence[Names]) -> Names:
    """Effects that all alternatives have, where each has another one besides."""
    shared = tuple(n for n in compared[0] if all(n in names for names in compared))
    return shared if all(len(names) > len(shared) for names in compared) else ()


def _without(names: Names, shared: Names) -> Names:
    return tuple(n for n in names if n not in shared)


def _words(names: Names) -> str:
    return " with ".join(f"{site} by {driver}" for site, driver in names)
