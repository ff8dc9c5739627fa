"""Derivatives that are assembled from those of one stage are those of the whole problem."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.greybox import Model
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.problem.derivatives import Assembled
from controllers.economic_mpc.problem.layout import DEGREE
from tests.controllers.plan.test_collocation import arguments, cell_problem, cold


@pytest.fixture(scope="module")
def problem(model: Model) -> OptimalControlProblem:
    return cell_problem(model, 3)


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
def test_derivatives_are_those_of_the_problem(problem: OptimalControlProblem, model: Model, solver: str) -> None:
    """Against CasADi's derivatives of the whole; the curvature is left out along the gas of each class, and only there.

    Solvers read every entry of a gradient, so a sparse one would be read beyond its end.
    """
    x, p, f, g = (problem.nlp[key] for key in ("x", "p", "f", "g"))
    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.numel())
    lagrangian = lam_f * f + ca.dot(lam_g, g)
    first = ca.Function("first", [x, p], [f, ca.gradient(f, x), g, ca.jacobian(g, x)])
    hessian = ca.Function("second", [x, p, lam_f, lam_g], [ca.gradient(lagrangian, x), ca.hessian(lagrangian, x)[0]])
    rng = np.random.default_rng(0)
    now, at = arguments(model), cold(problem, model)
    at = at * (1 + 0.02 * rng.normal(size=at.size))
    weights = (1.3, rng.normal(size=g.numel()))
    ours = Assembled(problem).functions(solver)
    _, gradient, _, jacobian = first(at, now)
    solution = ours["nlp_grad_f"](x=at, p=now)["grad_f_x"]
    assert solution.is_dense()
    np.testing.assert_allclose(np.array(solution), np.array(gradient), rtol=1e-9, atol=1e-9)
    solution = ours["nlp_jac_g"](x=at, p=now)["jac_g_x"]
    np.testing.assert_allclose(np.array(solution), np.array(jacobian), rtol=1e-9, atol=1e-9)

    slope, whole = (np.array(part) for part in hessian(at, now, *weights))
    second = ours["nlp_hess_l"](x=at, p=now, lam_f=weights[0], lam_g=weights[1])
    if solver == "fatrop":
        np.testing.assert_allclose(np.array(second["grad_gamma_x"]), slope, rtol=1e-9, atol=1e-9)
    layout = problem.layout
    gas = [i for i, name in enumerate(model.names("states")) if name.startswith("gas_")]
    left_out = [k * layout.block + layout.point(j) + i for k in range(3) for j in range(DEGREE) for i in gas]
    expected = np.triu(whole) if solver == "ipopt" else whole
    expected[left_out, :] = expected[:, left_out] = 0.0
    curvature = np.array(second["triu_hess_gamma_x_x" if solver == "ipopt" else "hess_gamma_x_x"])
    np.testing.assert_allclose(curvature, expected, rtol=1e-8, atol=1e-8)
