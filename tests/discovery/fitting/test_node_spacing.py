"""Coarser runs: taken only where nobody notices, and what leads is run at every row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.fitting.descent import nodes_for
from adaptive_flot.discovery.fitting.fit import Fit, loss_of
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import NOTICED, UNNOTICED, at_every_row, fitter_about, with_nodes
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.stepping.nodes import place_nodes, substeps
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.heated import Truth, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")


def _fitted(inputs: np.ndarray | None = None) -> tuple[Problem, Fit]:
    record = tank_record(Truth(exponent=0.0), inputs=inputs)
    problem = make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5)
    fit = Fitter(problem).fit(heated_tank())
    assert fit is not None
    return problem, fit


@pytest.fixture(scope="module")
def still() -> tuple[Problem, Fit]:
    """Inputs that stand still for 25 rows and more."""
    return _fitted()


def _at_every_row(problem: Problem, fit: Fit) -> np.ndarray:
    run = RecordSimulator(fit.model, problem.record.dt)
    return run.outputs(problem.record, fit.initial_state, fit.model.parameter_values)[:, problem.columns]


def test_the_coarser_run_is_within_a_fraction_of_the_noise(still: tuple[Problem, Fit]) -> None:
    problem, fit = still
    coarse = with_nodes(problem, fit)
    assert coarse.nodes is not None and len(coarse.nodes.rows) < 0.5 * len(problem.record)
    run = RecordSimulator(fit.model, problem.record.dt, coarse.nodes)
    free = run.outputs(problem.record, fit.initial_state, fit.model.parameter_values)
    assert np.sum(((free - _at_every_row(problem, fit)) / 0.05) ** 2) < 1.5 * UNNOTICED
    again = Fitter(coarse).fit(fit.model, like=fit)
    assert again is not None
    np.testing.assert_allclose(again.values, fit.values, atol=0.2 * fit.std().min())
    assert again.loss == pytest.approx(fit.loss, abs=NOTICED)


def test_where_the_inputs_never_rest_every_row_is_simulated() -> None:
    rng = np.random.default_rng(3)
    inputs = np.column_stack([rng.uniform(500, 3000, 400), rng.uniform(5, 20, 400)])
    problem, fit = _fitted(inputs)
    assert with_nodes(problem, fit).nodes is None


def test_a_leader_that_the_nodes_deceive_is_fitted_at_every_row(still: tuple[Problem, Fit]) -> None:
    """Nodes shifted against the moves: what is fitted there is not what the record says."""
    problem, fit = still
    nodes = place_nodes(problem.record, 6)
    wrong = replace(nodes, inputs=np.roll(nodes.inputs, 3, axis=0))
    deceived = Fitter(replace(problem, nodes=wrong)).fit(fit.model, like=fit)
    assert deceived is not None
    assert abs(loss_of(problem, _at_every_row(problem, deceived), problem.rows("estimate"))[0] - deceived.loss) > 10.0
    led = at_every_row(Fitter(replace(problem, nodes=wrong)), deceived, {})
    assert led.loss == pytest.approx(fit.loss, abs=1.0)
    np.testing.assert_allclose(led.values, fit.values, atol=float(fit.std().min()))


def test_a_fit_at_every_row_is_compared_with_one_at_every_row(still: tuple[Problem, Fit]) -> None:
    """By nodes that deceive, a fit without an idle effect looked worse than the one with it."""
    problem, fit = still
    nodes = place_nodes(problem.record, 6)
    wrong = replace(problem, nodes=replace(nodes, inputs=np.roll(nodes.inputs, 3, axis=0)))
    assert fitter_about(Fitter(wrong), fit).problem.nodes is None
    again = fitter_about(Fitter(wrong), fit).fit(fit.model, fit.names, like=fit, noise=fit.noise)
    assert again is not None and again.loss == pytest.approx(fit.loss, abs=1.0)
    coarse = Fitter(with_nodes(problem, fit))
    assert fitter_about(coarse, fit) is coarse  # nodes that make no difference
    assert fitter_about(Fitter(problem), fit).problem.nodes is None


def test_a_leader_whose_run_is_right_is_left_alone(still: tuple[Problem, Fit]) -> None:
    problem, fit = still
    coarse = Fitter(with_nodes(problem, fit))
    assert at_every_row(coarse, fit, {}) is fit
    assert at_every_row(Fitter(problem), fit, {}) is fit  # no nodes at all


@pytest.mark.parametrize(("form", "coarse"), [("shift", True), ("step", False)])
def test_what_is_sudden_is_simulated_at_every_row(still: tuple[Problem, Fit], form: str, coarse: bool) -> None:
    problem, fit = still
    driver = "constant" if form == "shift" else "time"
    found = with_nodes(problem, fit)
    model = fit.model.with_effects([Effect("heat_loss", driver, form)])
    assert found.nodes is not None and (nodes_for(found, model) is found.nodes) is coarse
    within = replace(problem, nodes=substeps(problem.record, 2))  # every row is there, and two steps in each
    assert nodes_for(within, model) is within.nodes


def test_a_coarsely_sampled_record_takes_longer_steps_that_make_no_difference() -> None:
    """A model that asks for fifteen steps a row, though one or two would do."""
    fine = replace(heated_tank(), max_step_s=2.0)
    problem = make_problem(tank_record(Truth(exponent=0.0)), fine, ADAPTED, burn_in=30, guard=5)
    every = Fitter(problem).fit(fine)
    assert every is not None
    coarse = with_nodes(problem, every)
    assert coarse.nodes is not None and len(coarse.nodes.times) < 4 * len(problem.record)
    again = Fitter(coarse).fit(fine, like=every)
    assert again is not None
    np.testing.assert_allclose(again.values, every.values, atol=0.2 * every.std().min())
    scores, others = (Responses(p, every).nuisance[1:] for p in (coarse, problem))
    np.testing.assert_allclose(scores, others, rtol=1e-3, atol=1e-3 * np.abs(others).max())
