"""A dip put in front of a plan."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.contracts import Estimate
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.planner import Found
from controllers.economic_mpc.probing.budget import Probing, price
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.solvers.verification import Solver, Validity
from controllers.economic_mpc.state import MpcState


def with_dip(
    probing: Probing,
    solver: Solver,
    problem: OptimalControlProblem,
    state: MpcState,
    held: FloatArray,
    estimate: Estimate,
    found: Found,
    scale: float,
) -> tuple[MpcState, Found]:
    """A valid plan with a dip in front where one is due, has a valid plan itself, and can be paid.

    Parameters
    ----------
    probing
        What is due, and what it may cost.
    solver, problem
        Of the plan.
    state, held, estimate
        Of the controller, inputs now (nu,), and the newest estimate.
    found
        The plan.
    scale
        Unit of the problem's prices in cu.
    """
    probe, value = state.probe, float(held[problem.layout.moved[probing.position]])
    if probe is None or not probing.is_due(probe, estimate, value):
        return state, found
    free, now = found.solution, found.arguments
    asked = solver(now, probing.bounds(value, found.bounds), free.variables, free.multipliers)
    if asked.validity is not Validity.VALID:
        return state, found
    cost = price(problem, free.variables, asked.variables, now) / scale
    probe, paid = probing.pay(probe, cost, estimate.time)
    dip = replace(found, solution=replace(asked, seconds=free.seconds + asked.seconds))
    return replace(state, probe=probe), dip if paid else found
