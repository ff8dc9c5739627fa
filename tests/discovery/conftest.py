"""Discoveries made once for several tests: each takes a second or three."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.greybox.data.dataset import Dataset
from tests.discovery.heated import Truth, heated_tank, moves, tank_record

POWER = (500.0, 3000.0)


@pytest.fixture(scope="session")
def draught() -> Discovery:
    """What is found in a record whose fan and power both move."""
    return discover(heated_tank(), tank_record())


@pytest.fixture(scope="session")
def even() -> Dataset:
    """A record at constant power: a draught that cools and a heater that fails look much alike in it."""
    inputs = np.column_stack([np.full(600, 1500.0), moves(600, 8, 12, 25, 1)])
    return tank_record(Truth(), 600, 1, inputs)


@pytest.fixture(scope="session")
def open_question(even: Dataset) -> Discovery:
    """What is found in it, when the power may be moved in a test."""
    return discover(heated_tank(), even, limits={"power": POWER})
