"""Protects the models of the benchmark on real records: they run, and their sites are what the judge asks for."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.results import Verdict, Word
from adaptive_flot.greybox import Dataset, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator
from benchmarks.real_records import air_handling_unit, electric_drives, heat_exchanger, lamp
from benchmarks.real_records.__main__ import worth_of

INPUTS = {
    "air handling unit": [15.0, 22.0, 0.3, 0.2, 0.1],
    "electric drives": [1.0],
    "heat exchanger": [0.3],
    "lamp over a plate": [8.0],
}


@pytest.mark.parametrize("module", [air_handling_unit, electric_drives, heat_exchanger, lamp])
def test_each_model_runs_to_rest(module: object) -> None:
    """Under constant inputs the outputs stay finite, and stop moving."""
    model: Model = module.make_model()  # type: ignore[attr-defined]
    n, dt = 400, 10 * model.max_step_s
    inputs = np.tile(INPUTS[model.name], (n, 1))
    data = Dataset("rest", dt * np.arange(n, dtype=np.float64), dt, inputs, np.zeros((n, len(model.outputs))))
    x0 = np.array([model.initial_guess[s.name] for s in model.states])
    outputs = RecordSimulator(model, dt).outputs(data, x0, model.parameter_values)
    assert np.isfinite(outputs).all()
    assert np.abs(np.diff(outputs[-10:], axis=0)).max() < 1e-3


def test_every_fault_is_at_a_site_of_the_model() -> None:
    sites = {s.name for s in air_handling_unit.make_model().sites}
    assert {part for part, _ in air_handling_unit.TRUTH.values()} <= sites
    assert {*air_handling_unit.SAME_PART, *air_handling_unit.SAME_PART.values()} <= sites
    assert electric_drives.TRUTH[0] in {s.name for s in electric_drives.make_model().sites}


@pytest.mark.parametrize(
    ("word", "sites", "worth"),
    [
        ("abstain", set(), "open"),
        ("named", {"valve"}, "right"),
        ("named", {"valve", "sensor"}, "wrong"),
        ("named", {"sensor"}, "wrong"),
        ("class", {"valve", "sensor"}, "right"),
        ("class", {"valve", "sensor", "damper"}, "wide"),
        ("class", {"sensor", "damper"}, "wrong"),
    ],
)
def test_a_verdict_is_worth_what_it_says_of_the_part_at_fault(word: Word, sites: set[str], worth: str) -> None:
    """No wrong part counts as right, and a class that holds the right part is never a wrong name."""
    assert worth_of("valve", Verdict(word, ""), sites) == worth
