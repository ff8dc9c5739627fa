"""Effects at no listed site: honest verdicts are `unnamed`, `class`, `abstain`. Strength runs from 0 (none) to 1."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.equations import POPULATIONS, Population, Structure
from benchmarks.hidden_effects.effects import curves
from benchmarks.hidden_effects.effects.spec import Spec

Rng = np.random.Generator


class Beyond(NamedTuple):
    """What acts at a strength, and what names would not be wrong: (site, driver), driver "*" for any."""

    kind: str
    strength: float
    specs: tuple[Spec, ...]
    structure: Structure | None
    tolerated: tuple[tuple[str, str], ...]


def _second_gangue(strength: float, rng: Rng, seconds: float) -> Beyond:
    """Part of the quartz floats much faster (composites), the rest as ever."""
    share, ratio = rng.uniform(0.01, 0.04), rng.uniform(20.0, 60.0) * strength
    quartz = POPULATIONS[1]
    structure = Structure((
        POPULATIONS[0],
        Population(quartz.feed * (1.0 - share), quartz.floatability, 1),
        Population(quartz.feed * share, quartz.floatability * (1.0 + ratio), 1),
    ))  # fmt: skip
    return Beyond("second_gangue", strength, (), structure, (("floatability_gangue", "*"),))


def _slow_valuable(strength: float, rng: Rng, seconds: float) -> Beyond:
    """Part of the chalcopyrite hardly floats, the rest faster."""
    share = rng.uniform(0.2, 0.4)
    ore = POPULATIONS[0]
    structure = Structure((
        Population(ore.feed * (1.0 - share), ore.floatability * (1.0 + strength), 0),
        POPULATIONS[1],
        Population(ore.feed * share, ore.floatability * (1.0 - 0.95 * strength), 0),
    ))  # fmt: skip
    return Beyond("slow_valuable", strength, (), structure, (("floatability_valuable", "*"),))


def _short_circuit(strength: float, rng: Rng, seconds: float) -> Beyond:
    """Part of the feed goes straight to the tails."""
    return Beyond("short_circuit", strength, (), Structure(bypass=0.6 * strength), (("feed_flow", "constant"),))


def _dead_volume(strength: float, rng: Rng, seconds: float) -> Beyond:
    """Part of the pulp only exchanges slowly with the rest: two tanks, not one."""
    exchange = rng.uniform(0.1, 0.4) * c.FEED_FLOW
    return Beyond("dead_volume", strength, (), Structure(dead_share=0.75 * strength, exchange_flow=exchange), ())


def _at_once(kind: str, strength: float, rng: Rng, seconds: float, powers: dict[str, float]) -> Beyond:
    """Several sites follow one hidden property in time, each by its physical share (to first order)."""
    shape = str(rng.choice(["gompertz", "swing", "wander"]))
    parameters = curves.draw_temporal(shape, seconds, rng)
    specs = tuple(
        Spec(site, "time", shape, math.copysign(1.0 - math.exp(-abs(p) * strength), p), parameters, story=kind)
        for site, p in powers.items()
    )
    return Beyond(kind, strength, specs, None, tuple((site, "time") for site in powers if site != "film_drainage"))


def _cooling(strength: float, rng: Rng, seconds: float) -> Beyond:
    """Colder water is more viscous: bubbles rise, particles settle and films drain slower, all at once."""
    return _at_once(
        "cooling", 0.7 * strength, rng, seconds, {"gas_slip": -1.0, "settling": -1.0, "film_drainage": -1.0}
    )


def _thickening(strength: float, rng: Rng, seconds: float) -> Beyond:
    """More solids in the feed: viscosity and crowding slow everything, and there is more to float."""
    powers = {"gas_slip": -0.6, "settling": -1.3, "film_drainage": -0.6, "feed_grade": 0.5}
    return _at_once("thickening", 0.6 * strength, rng, seconds, powers)


KINDS: dict[str, Callable[[float, Rng, float], Beyond]] = {
    "second_gangue": _second_gangue,
    "short_circuit": _short_circuit,
    "cooling": _cooling,
    "dead_volume": _dead_volume,
    "slow_valuable": _slow_valuable,
    "thickening": _thickening,
}


def draw_beyond(kind: str, strength: float, seed: int, seconds: float) -> Beyond:
    """The effect at a strength; the same seed draws the same details whatever the strength."""
    return KINDS[kind](strength, np.random.default_rng(seed), seconds)
