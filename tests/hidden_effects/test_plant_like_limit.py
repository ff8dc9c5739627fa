"""The limit of plant-like records: an effect that is given is visible where the record has it, and not elsewhere."""

import numpy as np
import pytest

from adaptive_flot.greybox.data.dataset import Dataset
from benchmarks.plant_like.limit import Gain, gain_of
from tests.discovery.heated import Truth, heated_tank, tank_record


@pytest.fixture(scope="module")
def calm() -> Dataset:
    """The tank as its model has it."""
    return tank_record(Truth(exponent=0.0))


def test_an_effect_of_the_record_is_visible() -> None:
    gain = gain_of(heated_tank(), tank_record(), ("heat_loss", "fan_speed"))
    assert gain.visible and gain.bic > 100


def test_an_effect_that_the_record_has_not_is_not_visible(calm: Dataset) -> None:
    gain = gain_of(heated_tank(), calm, ("heat_loss", "fan_speed"))
    assert not gain.visible and gain.rows_each >= 1


def test_what_the_catalogue_has_not_is_not_visible(calm: Dataset) -> None:
    gain = gain_of(heated_tank(), calm, ("heat_loss", "nobody"))
    assert np.isnan(gain.bic) and not gain.visible


def test_a_gain_counts_once_for_each_effective_sample() -> None:
    assert Gain(30.0, 2.0).visible and not Gain(30.0, 4.0).visible
