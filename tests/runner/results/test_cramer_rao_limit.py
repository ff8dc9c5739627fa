"""The bound of a scenario: the joint filter of a truth that walks reaches it, and claims it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.results.cramer_rao_limit import MORE_SENSORS, TrueRun, has_limit, limits
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation


def test_the_joint_filter_of_a_random_walk_is_within_1_3_of_the_bound() -> None:
    """Root mean square over the runs, as asked; its own covariance is the bound but for the point of linearisation."""
    scenario = load_scenario("random_walk")
    late = scenario.starts >= scenario.fits_after
    errors, claimed, bounds = [], [], []
    for seed in (1, 2, 3, 4):
        table = run_scenario(scenario, ["ekf"], [seed])[0].table
        limit = TrueRun(Realisation(scenario, seed), Realisation(scenario, seed).schedule).limit()
        bounds.append(np.diagonal(limit, axis1=1, axis2=2)[late])
        wrong = [table[f"{label}_estimate"] - table[f"{label}_true"] for label in "nC"]
        errors.append(np.column_stack(wrong)[late] ** 2)
        claimed.append(table[["n_std", "C_std"]].to_numpy()[late] ** 2)
    ratio = np.sqrt(np.mean(errors, axis=(0, 1)) / np.mean(bounds, axis=(0, 1)))
    assert (ratio < 1.3).all() and (ratio > 0.5).all(), ratio
    own = np.sqrt(np.mean(claimed, axis=(0, 1)) / np.mean(bounds, axis=(0, 1)))
    np.testing.assert_allclose(own, 1.0, atol=0.15)


def test_more_sensors_lower_the_bound_of_the_ridge() -> None:
    scenario = load_scenario("paper_scenario_1")
    assert has_limit(scenario)
    run = TrueRun(Realisation(scenario, 1), Realisation(scenario, 1).schedule)
    alone, more = run.limit(), run.limit(more=MORE_SENSORS)
    assert alone.shape == (2400, 2, 2)
    assert (np.diagonal(more, axis1=1, axis2=2) <= np.diagonal(alone, axis1=1, axis2=2) * (1 + 1e-9)).all()
    assert np.sqrt(more[-1, 1, 1] / alone[-1, 1, 1]) < 0.9


def test_runs_and_sets_of_sensors_in_one_pass_are_bounded_as_one_by_one() -> None:
    """Open loop with two seeds; a sensor that only one set has says nothing to the other."""
    scenario = load_scenario("random_walk")
    scenario = replace(scenario, file=scenario.file.model_copy(update={"duration_s": 700.0}))
    runs = [TrueRun(Realisation(scenario, seed), Realisation(scenario, seed).schedule) for seed in (1, 2)]
    found = limits(runs, [{}, MORE_SENSORS])
    assert found.shape == (2, 2, 700, 2, 2)
    for run, pair in zip(runs, found, strict=True):
        for more, covariance in zip(({}, MORE_SENSORS), pair, strict=True):
            alone = run.limit(more=more)
            scale = np.sqrt(np.diagonal(alone, axis1=1, axis2=2))
            np.testing.assert_allclose((covariance - alone) / scale[:, :, None] / scale[:, None, :], 0.0, atol=1e-8)


def test_a_fit_of_the_bound_is_that_of_an_error_of_its_size() -> None:
    """One percent of the truth at every time is a fit of 99; what comes before the fits is of no account."""
    scenario = load_scenario("paper_scenario_1")
    run = TrueRun(Realisation(scenario, 1), Realisation(scenario, 1).schedule)
    covariance = np.zeros((2400, 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = (0.01 * run.adapted[:, 0]) ** 2, (0.05 * run.adapted[:, 1]) ** 2
    covariance[:600] *= 1e6
    np.testing.assert_allclose(run.fits(covariance), [99.0, 95.0], rtol=1e-12)
