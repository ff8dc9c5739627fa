"""The joint search: how evidence is counted, what confirms it, and that an overflowing tank is no clipped sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.record.screening import screen
from adaptive_flot.discovery.search.joint_fits import correlation_time, cross_validated
from adaptive_flot.discovery.search.joint_search import dominated
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.processes import cascaded_tanks

MODEL = cascaded_tanks.make_model()
NAMES = tuple(p.name for p in MODEL.parameters)


def record(noise: FloatArray, effects: tuple[Effect, ...] = ()) -> Dataset:
    """400 samples of tanks whose pump steps."""
    n = len(noise)
    rng = np.random.default_rng(3)
    pump = np.repeat(rng.uniform(1.0, 4.0, n // 20 + 1), 20)[:n, None]
    bare = Dataset("tanks", 4.0 * np.arange(n, dtype=float), 4.0, pump, np.full((n, 1), np.nan))
    plant = MODEL.with_effects(effects)
    y = RecordSimulator(plant, 4.0).outputs(bare, np.array([5.0, 5.0]), plant.parameter_values)
    return replace(bare, outputs=y + noise[:, None])


@pytest.fixture(scope="module")
def white() -> tuple[Problem, Fit]:
    noise = 0.02 * np.random.default_rng(1).standard_normal(400)
    problem = make_problem(record(noise), MODEL, NAMES, burn_in=10, guard=2)
    fit = Fitter(problem).fit(MODEL)
    assert fit is not None
    return problem, fit


def test_correlation_time_of_an_autoregression_is_known(white: tuple[Problem, Fit]) -> None:
    """(1 + phi) / (1 - phi) for a first-order autoregression (Sokal 1997)."""
    problem, fit = white
    rng = np.random.default_rng(5)
    for phi in (0.0, 0.6, 0.9):
        e = np.asarray(lfilter([1.0], [1.0, -phi], rng.standard_normal(200_000)))[:, None]
        long = replace(problem, record=replace(problem.record, outputs=e), splits=np.full(len(e), "estimate"))
        found = correlation_time(long, replace(fit, predicted=np.zeros_like(e)))
        assert found == pytest.approx((1 + phi) / (1 - phi), rel=0.15)


def test_cross_validation_of_a_right_model_is_as_good_as_its_fit(white: tuple[Problem, Fit]) -> None:
    """Rows that a fit did not see are predicted to the noise, and not by the very same fit."""
    problem, fit = white
    rows = problem.rows("estimate")
    left_out = cross_validated(problem, fit, processes=1)
    rms = [float(np.sqrt(np.mean(f.residual(problem)[rows] ** 2))) for f in (fit, left_out)]
    assert rms[0] < rms[1] < 1.2 * rms[0]


def test_a_model_without_spill_is_dominated_by_its_error(white: tuple[Problem, Fit]) -> None:
    """Noise alone does not call for the joint search; a law that is missing does."""
    problem, fit = white
    assert not dominated(problem, fit)
    law = Effect("lower_outflow", "lower_level", "overflow", {"slope": 0.03, "gain": 0.0, "threshold": 5.0})
    other = make_problem(record(0.02 * np.ones(400), (law,)), MODEL, NAMES, burn_in=10, guard=2)
    assert dominated(other, replace(fit, predicted=problem.measured))


def test_a_level_that_stays_at_its_highest_is_kept_where_the_process_can_hold_it() -> None:
    """A tank that overflows is physics; the same series of another model's sensor is clipped."""
    full = record(0.02 * np.random.default_rng(2).standard_normal(400))
    full = replace(full, outputs=np.minimum(full.outputs, np.quantile(full.outputs, 0.9)))
    kept = screen(full, MODEL)
    assert np.isfinite(kept.record.outputs).all() and "kept" in " ".join(kept.notes)
    cut = screen(full, replace(MODEL, edges=()))
    assert np.isnan(cut.record.outputs).sum() >= 30 and "left out" in " ".join(cut.notes)
