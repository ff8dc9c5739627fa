"""Free runs of many records at once, with their derivatives: a record and its unknowns are one lane of machine code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.ensemble.steady_states import SteadyStates
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping import step_functions
from adaptive_flot.greybox.stepping.step_functions import Interval
from estimators.pem.problem import Problem


@dataclass(frozen=True)
class RunsInStep:
    """Free runs of M records from their unknowns.

    Attributes
    ----------
    good
        Which have a start (M,); the others hold numbers without a meaning.
    parameters, start
        Parameter vectors (M, np) and initial states (M, nx).
    outputs, gradient
        Driving outputs (M, N, m) and their derivatives for the scaled unknowns (M, N, m, d).
    last_state, last_gradient
        State at the last row (M, nx) and its derivatives (M, nx, d).
    """

    good: NDArray[np.bool_]
    parameters: FloatArray
    start: FloatArray
    outputs: FloatArray
    gradient: FloatArray
    last_state: FloatArray
    last_gradient: FloatArray

    def replaced(self, places: NDArray[np.int64], others: RunsInStep) -> RunsInStep:
        """These runs, in some places other ones: the arrays are written to."""
        for field in fields(self):
            getattr(self, field.name)[places] = getattr(others, field.name)
        return self


@dataclass(frozen=True)
class Batch:
    """M records of the same times (N,), and of each its inputs (M, N, nu) and its problem.

    Attributes
    ----------
    time, inputs
        Those of the records.
    centre, scale, steady
        Those of the problems, (M, d), (M, d) and (M, nx).
    """

    time: FloatArray
    inputs: FloatArray
    centre: FloatArray
    scale: FloatArray
    steady: FloatArray

    @classmethod
    def of(cls, records: Sequence[Dataset], problems: Sequence[Problem]) -> Batch:
        """Stack records and problems."""
        stacked = [np.array([getattr(p, name) for p in problems]) for name in ("centre", "scale", "steady")]
        return cls(records[0].time, np.array([r.inputs for r in records]), *stacked)

    def part(self, places: NDArray[np.int64]) -> Batch:
        """The records in some places."""
        return Batch(self.time, *(a[places] for a in (self.inputs, self.centre, self.scale, self.steady)))


class FreeRunsInStep:
    """Free runs of records with the same times.

    Parameters
    ----------
    setup
        Model, sampling interval, the q parameters to fit and the m outputs to fit them to.
    steady
        Whether a run starts at the steady state of its first inputs, which moves with the parameters.
    free
        States that are fitted (their positions).
    """

    def __init__(self, setup: Setup, steady: bool, free: Sequence[int]) -> None:
        self.setup, self._steady, self._free = setup, steady, list(free)
        model, names = setup.model, setup.parameters
        self._adapted = model.indices("parameters", names)
        self._unknowns = len(names) + len(self._free)
        columns = tuple(model.indices("outputs", setup.outputs))
        interval = Interval(setup.dt, model.steps_in(setup.dt))
        step = model.derived(_step_of_outputs, interval, names, self._unknowns, columns)
        carried, matrices = {"x": "x_next", "S": "S_next"}, ("S", "S_next", "dy")
        self._step = Lanes(step, carried, matrices, as_machine_code=model.compiled)
        first = model.derived(_first_outputs, names, self._unknowns, columns)
        self._first = Lanes(first, {}, matrices, as_machine_code=model.compiled)
        self._states = SteadyStates(model, names)

    def steady_starts(self, records: Sequence[Dataset]) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Steady states (M, nx) at the first inputs of records, with the model's parameters, and which were found."""
        first = np.array([r.inputs[0] for r in records])
        p = np.tile(self.setup.model.parameter_values, (len(records), 1))
        return self._states.find(first, p, time=float(records[0].time[0]))

    def __call__(self, batch: Batch, unknowns: FloatArray) -> RunsInStep:
        """Runs from unknowns (M, d)."""
        q, time, members = len(self._adapted), batch.time, len(unknowns)
        values = batch.centre + batch.scale * unknowns
        p = np.tile(self.setup.model.parameter_values, (members, 1))
        p[:, self._adapted] = values[:, :q]
        inputs, scale = batch.inputs, batch.scale
        x0, good = batch.steady.copy(), np.ones(members, dtype=bool)
        moved = np.zeros((*x0.shape, self._unknowns))
        if self._steady:
            x0, good = self._states.find(inputs[:, 0], p, x0, float(time[0]))
            x0[~good] = batch.steady[~good]  # of no meaning, but finite
            moved[:, :, :q] = self._states.gradient(x0, inputs[:, 0], p, float(time[0]))
        x0[:, self._free] = values[:, q:]
        moved[:, self._free, q + np.arange(len(self._free))] = 1.0
        at = {"x": x0, "S": moved, "p": p}
        start = {**at, "t": time[:1], "u": inputs[:, 0]}
        first = self._first(members, 1, start, {}, every=["y", "dy"])
        rest = self._step(
            members,
            len(time) - 1,
            at,
            {"t": time[:-1, None], "u": inputs[:, 1:]},
            every=["y", "dy"],
            last=["x_next", "S_next"],
        )
        outputs, gradient = (np.concatenate([first[name], rest[name]], axis=1) for name in ("y", "dy"))
        gradient *= scale[:, None, None, :]
        return RunsInStep(good, p, x0, outputs, gradient, rest["x_next"], rest["S_next"] * scale[:, None, :])


def _step_of_outputs(
    model: Model, interval: Interval, wrt: tuple[str, ...], unknowns: int, columns: tuple[int, ...]
) -> ca.Function:
    """`sensitivity_step` with some of the outputs alone."""
    whole = model.derived(step_functions.sensitivity_step, interval, wrt, unknowns)
    symbols = whole.sx_in()
    x_next, S_next, y, dy = whole.call(symbols)
    chosen = list(columns)
    results, names = [x_next, S_next, y[chosen], dy[chosen, :]], ["x_next", "S_next", "y", "dy"]
    return ca.Function("step_of_outputs", symbols, results, whole.name_in(), names)


def _first_outputs(model: Model, wrt: tuple[str, ...], unknowns: int, columns: tuple[int, ...]) -> ca.Function:
    """`(x, S, t, u, p) -> (y, dy)` at one instant, of some of the outputs."""
    t, x, u, p = model.ode.sx_in()
    moved = ca.SX.sym("S", x.numel(), unknowns)
    y = model.ode(t, x, u, p)[1][list(columns)]
    by_p = ca.densify(ca.jacobian(y, p)[:, model.indices("parameters", wrt)])
    along = ca.jacobian(y, x) @ moved + ca.horzcat(by_p, ca.SX.zeros(y.numel(), unknowns - len(wrt)))
    names = ["x", "S", "t", "u", "p"], ["y", "dy"]
    return ca.Function("first_outputs", [x, moved, t, u, p], [ca.densify(y), ca.densify(along)], *names)
