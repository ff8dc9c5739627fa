"""Effects: nothing at amplitude zero, what their size means, and names that say the same."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hidden_effects.cell.sites import DRIVERS, LISTED_SITES, OUTPUTS
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE, equivalents
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.generate.draw import draw_effect, draw_experiment
from benchmarks.hidden_effects.generate.sizing import measure
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, run
from benchmarks.hidden_effects.plant.sensors import Fault, SensorEffect


def _experiment(rows: int, seed: int = 5) -> Experiment:
    """A short record in open loop with white noise."""
    drawn = draw_experiment(np.random.default_rng(seed), thin_allowed=False, loop="open")
    noise = replace(drawn.noise, step=dict.fromkeys(OUTPUTS, 0.0))
    return replace(drawn, rows=rows, burn=0, moves=drawn.moves[:rows], noise=noise)


@pytest.fixture(scope="module")
def short() -> Experiment:
    return _experiment(240)


@pytest.fixture(scope="module")
def pilot(short: Experiment) -> SimulatedRun:
    return run(short)


@pytest.mark.parametrize("site", LISTED_SITES)
def test_effects_of_size_zero_are_the_nominal_cell(site: str, short: Experiment, pilot: SimulatedRun) -> None:
    """All effects at a site, at amplitude 0, leave every output as it is (to the integrator's tolerance)."""
    rng = np.random.default_rng(1)
    specs = [replace(draw_effect(rng, e, pilot), amplitude=0.0) for e in CATALOGUE if e.site == site]
    done = run(short, specs)
    for name in OUTPUTS:
        np.testing.assert_allclose(done.clean[name], pilot.clean[name], rtol=2e-5)


def test_the_catalogue_has_every_site_and_driver() -> None:
    """The lists of sites and drivers, without which no figure of the benchmark speaks for all of them."""
    assert {e.site for e in CATALOGUE} == set(LISTED_SITES)
    assert {e.driver for e in CATALOGUE} == set(DRIVERS)


def test_size_is_the_change_over_the_noise_where_n_and_C_can_not_hide_it() -> None:
    """Air recovery hardly depends on n and C: an offset of six noise standard deviations has size six."""
    experiment = _experiment(900)
    noise = float(np.std(run(experiment).noisy["air_recovery"] - run(experiment).clean["air_recovery"]))
    spec = Spec("air_recovery_sensor", "constant", "offset", 6.0, unit=noise)
    sized = measure(experiment, [spec])
    assert sized.raw["air_recovery"] == pytest.approx(6.0, rel=1e-2)
    assert sized.removable["air_recovery"] == pytest.approx(6.0, rel=2e-2)
    assert sized.removable["concentrate_grade"] < 0.1


def test_a_constant_change_of_C_is_no_effect() -> None:
    """What the adapted parameters take up entirely is not removable."""
    sized = measure(_experiment(900), [Spec("coalescence", "constant", "level", 0.03)])
    assert sized.raw["concentrate_grade"] > 1.0
    assert sized.removable["concentrate_grade"] < 0.1 * sized.raw["concentrate_grade"]


def test_level_and_froth_depth_are_one_driver(short: Experiment, pilot: SimulatedRun) -> None:
    """The mirrored curve over the level gives the same record: naming either is right."""
    low, high = 0.05, 0.15
    depth = Spec("entrainment", "froth_depth", "logistic", 0.4, {"middle": 0.4, "width": 0.1}, low, high, 0.5)
    level = replace(depth, driver="level", amplitude=-0.4, parameters={"middle": 0.6, "width": 0.1},
                    low=0.48 - high, high=0.48 - low)  # fmt: skip
    a, b = run(short, [depth]), run(short, [level])
    assert np.ptp(a.clean["concentrate_grade"] - pilot.clean["concentrate_grade"]) > 1e-4
    np.testing.assert_allclose(a.clean["concentrate_grade"], b.clean["concentrate_grade"], rtol=1e-5)
    assert {e["driver"] for e in equivalents("entrainment", "froth_depth", "logistic")} == {"level"}


def test_sensor_dynamics_on_a_ramp() -> None:
    """On a ramp of slope 1, lags and a dead time are late by exactly their seconds; an analyser by up to its cycle."""
    late = {}
    for shape, seconds in (("cascade", 4.0), ("dead_time", 7.3), ("multiplexed", 10.0)):
        effect = SensorEffect(Spec("grade_sensor", "lag", shape, seconds))
        late[shape] = [t - effect(float(t), float(t), {}) for t in range(200)][-20:]
    assert np.allclose(late["cascade"], 4.0 * 1.35, atol=1e-6)
    assert np.allclose(late["dead_time"], 7.3)
    assert min(late["multiplexed"]) == 0.0 and max(late["multiplexed"]) == 9.0


def test_faults_spoil_what_they_say_and_nothing_else() -> None:
    """A gap is missing, a frozen sensor holds, a clipped one stops at its limit."""
    y = np.linspace(0.0, 1.0, 100)
    gap = Fault("gap", "x", 10.0, 5.0).apply(y)
    assert np.isnan(gap[10:15]).all() and np.array_equal(np.delete(gap, np.s_[10:15]), np.delete(y, np.s_[10:15]))
    assert np.ptp(Fault("frozen", "x", 40.0, 999.0).apply(y)[40:]) == 0.0
    assert Fault("clipped", "x", 0.0, 100.0, 0.5).apply(y).max() == 0.5
