"""From the option `probing` to one of the two ways to probe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adaptive_flot.contracts import ControllerSetup, Economics, Estimate, Limits
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.planner import Found
from controllers.economic_mpc.probing.budget import Probing
from controllers.economic_mpc.probing.dips import with_dip
from controllers.economic_mpc.probing.knowledge import Knowledge
from controllers.economic_mpc.problem.collocation import OptimalControlProblem
from controllers.economic_mpc.solvers.verification import Solver
from controllers.economic_mpc.state import MpcState

WAYS = ("budget", "value")


def make_probing(
    setup: ControllerSetup,
    problem: OptimalControlProblem,
    limits: Limits,
    economics: Economics,
    options: Mapping[str, Any],
) -> Probing | Knowledge:
    """Build the way that the option `by` names: `budget` (default) or `value`.

    Raises
    ------
    ModelError
        An unknown way, or an option outside its range.
    """
    rest = {key: value for key, value in options.items() if key != "by"}
    way = options.get("by", "budget")
    if way not in WAYS:
        raise ModelError(f"probing: by = {way!r}; {near_match(str(way), WAYS)}")
    if way == "value":
        if rest.get("noise_std") is None:
            raise ModelError(
                "probing: by: value needs noise_std; give the standard deviation of the noise of each measured output, "
                "for example {concentrate_grade: 1.0e-3}"
            )
        return Knowledge(setup, problem, limits, economics, **rest)
    return Probing(problem.layout, limits, **rest)


def probed(
    probing: Probing | Knowledge,
    solver: Solver,
    problem: OptimalControlProblem,
    state: MpcState,
    held: FloatArray,
    estimate: Estimate,
    found: Found,
    scale: float,
) -> tuple[MpcState, Found]:
    """A valid plan, or what is applied instead to learn; arguments as in `with_dip`."""
    if isinstance(probing, Knowledge):
        return probing.chosen(solver, state, held, estimate, found, scale)
    return with_dip(probing, solver, problem, state, held, estimate, found, scale)
