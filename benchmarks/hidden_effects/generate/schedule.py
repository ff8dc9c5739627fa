"""Which record is what: record k of a seed is the same whatever the number of records."""

from __future__ import annotations

import numpy as np

from benchmarks.hidden_effects.cell.sites import SENSOR_SITES
from benchmarks.hidden_effects.effects.beyond import KINDS as BEYOND
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE, Entry

CYCLE = (
    "single", "none", "single", "drift", "single", "pair", "single", "beyond", "single", "unexcited",
    "single", "none", "single", "drift", "single", "pair", "single", "fault", "single", "single",
    "single", "none", "single", "drift", "single", "pair", "single", "beyond", "single", "unexcited",
)  # fmt: skip
CATEGORIES = tuple(dict.fromkeys(CYCLE))
FAULTS = ("frozen_grade", "gap", "clipped_grade", "frozen_level", "dead_air_recovery", "gap_all")
UNEXCITED = ("air_flow", "feed_flow", "late", "actuator", "level")


def category(k: int) -> str:
    """Category of record k."""
    return CYCLE[k % len(CYCLE)]


def position(k: int) -> int:
    """How many records of the same category come before record k."""
    cycle, at = divmod(k, len(CYCLE))
    name = CYCLE[at]
    return cycle * CYCLE.count(name) + CYCLE[:at].count(name)


def child(seed: int, k: int, attempt: int = 0) -> np.random.Generator:
    """Random numbers of one attempt at record k."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k, attempt)))


def _shuffled(seed: int, what: int, count: int) -> list[int]:
    order = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2**31, what))).permutation(count)
    return [int(i) for i in order]


def single_entry(seed: int, k: int) -> Entry:
    """The effect of a record with one: every entry of the catalogue in turn, in the order of the seed."""
    return CATALOGUE[_shuffled(seed, 0, len(CATALOGUE))[position(k) % len(CATALOGUE)]]


def pair_entries(seed: int, k: int) -> tuple[Entry, Entry]:
    """Two effects at different sites, at most one of them at a sensor."""
    order, at = _shuffled(seed, 1, len(CATALOGUE)), 2 * position(k)
    first = CATALOGUE[order[at % len(CATALOGUE)]]
    for step in range(1, len(CATALOGUE)):
        second = CATALOGUE[order[(at + step) % len(CATALOGUE)]]
        sensors = sum(e.site in SENSOR_SITES for e in (first, second))
        froth = {first.site, second.site} == {"coalescence", "growth_exponent"}
        if second.site != first.site and sensors < 2 and not froth:
            return first, second
    raise AssertionError("the catalogue has more than one site")


def beyond_kind(seed: int, k: int) -> str:
    """Effect out of the catalogue."""
    return list(BEYOND)[(_shuffled(seed, 2, len(BEYOND))[0] + position(k)) % len(BEYOND)]


def fault_kind(seed: int, k: int) -> str:
    """Fault of the data."""
    return FAULTS[(_shuffled(seed, 3, len(FAULTS))[0] + position(k)) % len(FAULTS)]


def unexcited_kind(seed: int, k: int) -> str:
    """What the record fails to move."""
    return UNEXCITED[(_shuffled(seed, 4, len(UNEXCITED))[0] + position(k)) % len(UNEXCITED)]
