"""The random streams of a run: what is drawn from a seed, each quantity from a stream of its own.

A stream is a generator of `numpy` that is seeded with `[seed, number, ...]`. So one quantity can be drawn in another
order, or not at all, and no other changes a bit.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Numbers of the streams. They are part of every result: a number that is taken stays as it is."""

    MEASUREMENT_NOISE = 0
    """Noise of the outputs (`measurements`)."""
    INPUT_OF_RUN = 1
    """Levels of a random input that is drawn again for each run (`seed: per_run`)."""
    INPUT = 2
    """Levels of a random input that is the same in all runs; its own seed takes the place of the run's."""
    DISTURBANCE_NOISE = 3
    """Noise of what is measured of disturbances (`disturbances`)."""
    FAULT = 4
    """Chance in faults (`faults`), a stream for each entry."""
    RANDOM_WALK_OF_RUN = 6
    """Random walk of a parameter that is drawn again for each run, a stream for each parameter."""
    RANDOM_WALK = 7
    """Random walk of a parameter that is the same in all runs; its own seed takes the place of the run's."""
    FEED_WALK_OF_RUN = 8
    """Feed that wanders (`plant.feed_walk`) and is drawn again for each run, a stream for each quantity."""
    FEED_WALK = 9
    """Feed that wanders and is the same in all runs; its own seed takes the place of the run's."""


def generator(seed: int, stream: Stream, *within: int) -> np.random.Generator:
    """Generator at the start of a stream.

    Parameters
    ----------
    seed
        Seed of the run, or of the entry that fixes its own.
    stream
        Which stream.
    within
        Numbers that tell several streams of one kind apart: the entry of a fault, the name of a parameter.
    """
    return np.random.default_rng([seed, int(stream), *within])
