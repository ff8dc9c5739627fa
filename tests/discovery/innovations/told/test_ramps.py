"""A change that grows slowly and stays, such as fouling, is told with its times where a reference shows the rest."""

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.search.explanation import numbers_of
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.since_reference.changes import find_changes
from benchmarks.other_processes.plants.heat_exchanger import make_model as model
from tests.discovery.innovations.exchanger import BEGINS, ENDS, FOULED, record


@pytest.mark.parametrize("seed", [0])
def test_fouling_is_told_with_its_size_and_times(seed: int) -> None:
    verdict = find_changes(model(), [record("fouls", seed=seed)], [record("nothing", seed=100 + seed)]).verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.driver, told.effect.form) == ("transfer", "time", "ramp")
    c = told.effect.coefficients
    assert np.exp(c["amplitude"]) == pytest.approx(1 - FOULED, abs=0.08)
    assert c["onset"] == pytest.approx(BEGINS, abs=400.0)
    assert c["onset"] + c["duration"] == pytest.approx(ENDS, abs=400.0)
    assert "smaller, gradually from" in verdict.reason


@pytest.mark.parametrize("seed", range(2))
def test_what_wanders_as_on_the_reference_is_no_gradual_change(seed: int) -> None:
    verdict = find_changes(model(), [record("nothing", seed=seed)], [record("nothing", seed=100 + seed)]).verdict
    assert verdict.word in ("none", "abstain") and not verdict.effects, verdict.reason


def test_a_ramp_costs_its_size_and_both_of_its_times() -> None:
    data, plain = record("fouls"), model()
    search = Search(plain, data, (0,), noise_floor([data], (0,)), ("ua", "holdup"), since_reference=True)
    with np.errstate(all="ignore"):
        screening = search.screening(search.base(plain.parameter_values), ["transfer"])
        found = screening.ramp(next(s for s in plain.sites if s.name == "transfer"))
    assert found is not None and found.suspect.cost == numbers_of(found.suspect.hypothesis) == 3
    assert found.suspect.hypothesis.pulses[0][0] == found.suspect.hypothesis.effect.coefficients["onset"]


def test_without_a_reference_process_noise_tells_what_the_free_run_does_not() -> None:
    """For a free run the thermometer, the steam and the meter drift about as well: it tells nothing."""
    found = discover(model(), record("fouls"))
    verdict = found.verdict
    assert verdict.word == "named", verdict.reason
    (told,) = verdict.effects
    assert (told.effect.site, told.effect.form) == ("transfer", "ramp")
    assert np.exp(told.effect.coefficients["amplitude"]) == pytest.approx(1 - FOULED, abs=0.05)
    assert told.effect.coefficients["onset"] == pytest.approx(BEGINS, abs=200.0)


def test_a_small_event_is_not_told_from_what_wanders() -> None:
    """Steam that wanders gave the thermometer of this record two switches of 0.15 K."""
    verdict = discover(model(), record("nothing", seed=1)).verdict
    assert verdict.word in ("none", "abstain") and not verdict.effects, verdict.reason
