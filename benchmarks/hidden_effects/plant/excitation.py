"""Moves of air, level set-point and feed flow in open loop, row k held during second k."""

from __future__ import annotations

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.simulate import Array

Rng = np.random.Generator
KINDS = ("random_steps", "two_level", "multisine", "staircase", "campaign")
_LEVEL = (0.34, 0.41)


def hold(rng: Rng, count: int, low: float, high: float, seconds: tuple[float, float]) -> Array:
    """Uniform values, each held for a random while, (count,)."""
    values = np.empty(count)
    k = 0
    while k < count:
        length = int(rng.uniform(*seconds))
        values[k : k + length] = rng.uniform(low, high)
        k += length
    return values


def _two_level(rng: Rng, count: int, low: float, high: float, seconds: tuple[float, float]) -> Array:
    """Two values in turn, each held for a random while."""
    values = np.empty(count)
    k, at = 0, int(rng.integers(2))
    while k < count:
        length = int(rng.uniform(*seconds))
        values[k : k + length] = (low, high)[at]
        k, at = k + length, 1 - at
    return values


def _sines(rng: Rng, count: int, low: float, high: float, every: int) -> Array:
    """Five sines of 90 to 1200 s together, held for `every` seconds at a time."""
    t = np.arange(0, count, every)
    periods = np.exp(rng.uniform(np.log(90.0), np.log(1200.0), 5))
    sum_ = np.sum([np.sin(2.0 * np.pi * (t / p + rng.random())) for p in periods], axis=0)
    sum_ /= np.abs(sum_).max()
    return np.repeat(0.5 * (low + high) + 0.5 * (high - low) * sum_, every)[:count]


def _staircase(rng: Rng, count: int, low: float, high: float) -> Array:
    """Up and down in equal steps."""
    steps, length = int(rng.integers(5, 8)), int(rng.uniform(80.0, 150.0))
    up = np.linspace(low, high, steps)
    cycle = np.concatenate([up, up[-2:0:-1]])
    start = int(rng.integers(len(cycle)))
    return np.resize(np.repeat(np.roll(cycle, start), length), count)


def open_loop(rng: Rng, count: int, kind: str) -> Array:
    """Inputs (count, 3) in the order Q_air, Q_feed [m3/s], level set-point [m]."""
    low, high = c.AIR_LIMITS[0] * 1.02, c.AIR_LIMITS[1] * 0.98
    feed = hold(rng, count, 0.92 * c.FEED_FLOW, 1.08 * c.FEED_FLOW, (250.0, 500.0))
    match kind:
        case "random_steps":
            air = hold(rng, count, low, high, (40.0, 120.0))
            level = hold(rng, count, *_LEVEL, (120.0, 260.0))
        case "two_level":
            middle = rng.uniform(1.35e-3, 1.7e-3)
            air = _two_level(rng, count, middle * 0.75, middle * 1.25, (50.0, 200.0))
            level = hold(rng, count, *_LEVEL, (150.0, 300.0))
        case "multisine":
            air = _sines(rng, count, low, high, 15)
            level = _sines(rng, count, *_LEVEL, 60)
        case "staircase":
            air = _staircase(rng, count, low, high)
            level = hold(rng, count, *_LEVEL, (150.0, 300.0))
        case "campaign":
            middle, depth = rng.uniform(1.3e-3, 1.75e-3), rng.uniform(0.36, 0.39)
            air = hold(rng, count, 0.85 * middle, 1.15 * middle, (120.0, 240.0))
            level = hold(rng, count, depth - 0.015, depth + 0.015, (200.0, 400.0))
        case _:
            raise KeyError(kind)
    return np.column_stack([air, feed, level])
