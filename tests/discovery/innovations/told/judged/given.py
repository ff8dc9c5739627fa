"""Explanations with given criteria, and a search that knows them: what the judgement rests on, without a fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations import judge as judging
from adaptive_flot.discovery.innovations.search.explanation import worth
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import rivals
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.effects import Effect

ROWS = 200


@dataclass(frozen=True)
class Given:
    """An explanation with a criterion and fresh rows that are given, not fitted."""

    hypotheses: tuple[Hypothesis, ...]
    criterion: float
    fresh: float
    numbers: int = 0
    slope: float = 0.0
    fit: Any = field(default_factory=lambda: Rows(np.zeros(ROWS)))


@dataclass(frozen=True)
class Rows:
    rows: np.ndarray


class Stand:
    """A search that knows three explanations; without an effect, an explanation is the rest of it."""

    record = Dataset(
        "", np.arange(0, 10.0 * ROWS, 10.0), 10.0, np.sign(np.arange(ROWS) // 20 % 2.0)[:, None], np.zeros((ROWS, 1))
    )
    """An input that is switched every 200 s."""
    processes = 1

    def __init__(self, *known: Given, since_reference: bool = False) -> None:
        self.since_reference = since_reference
        self.known = {tuple(h.site for h in e.hypotheses): e for e in known}
        self.known |= {tuple(h.effect.label for h in e.hypotheses): e for e in known}

    def model_of(self, explanation: Given) -> Any:
        """A model whose only parameter is the slope of a span."""
        return SimpleNamespace(parameters=[SimpleNamespace(name=SPAN.parameters[0], value=explanation.slope)])

    def without(self, explanation: Given, left_out: Hypothesis) -> Given:
        rest = [h for h in explanation.hypotheses if h is not left_out]
        return self.known.get(tuple(h.effect.label for h in rest)) or self.known[tuple(h.site for h in rest)]

    def late_elsewhere(self, explanation: Given, late: Hypothesis) -> list[Given]:
        """A lag explains half as much at another place."""
        return [Given((lag("elsewhere"),), explanation.criterion / 2, 0.1)]


def lag(site: str) -> Hypothesis:
    """A lag at a site."""
    return Hypothesis(
        site, "lag", "lag", Effect(site, "lag", "lag", settings={"scale": 1.0}), ("time_constant",), ({},)
    )


def event(site: str, *times: tuple[float, float]) -> Hypothesis:
    """Something that is switched on for a while, at times [s]."""
    told = {f"{name}_{k}": t for k, pair in enumerate(times, 1) for name, t in zip(("on", "for"), pair, strict=True)}
    effect = Effect(site, "time", "switch", told, {"count": float(len(times)), "width": 0.5}, mode="offset")
    return Hypothesis(site, "time", "switch", effect, ("amplitude",), ({},))


SPAN = Hypothesis("sensor", "own_value", "span", Effect("sensor", "own_value", "span", settings={"middle": 1.0}),
                  ("slope",), ({},), {"slope": (-0.3, 0.3)})  # fmt: skip


def shift(site: str) -> Hypothesis:
    """A constant error at a site."""
    return Hypothesis(site, "constant", "offset", Effect(site, "constant", "shift"), ("amplitude",), ({},))


def told(*found: Given, since_reference: bool = False) -> Told:
    base = Given((), 0.0, 0.0)
    search: Any = Stand(base, *found, since_reference=since_reference)
    ranked: Any = sorted([base, *found], key=lambda e: -worth(e))
    return judging.judge(search, ranked[-1], ranked)


def asked_again(said: Told, *found: Given) -> Told:
    """What is told by the rule on two effects; `found` is what the search knows."""
    base: Any = Given((), 0.0, 0.0)
    search: Any = Stand(base, *found)
    return rivals.not_two(search, base, said)
