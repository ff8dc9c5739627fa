"""Replay a model over a whole record, the first row included, with or without sensitivities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.nodes import Nodes, NodeStepper
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.trajectory import Sensitivities, Trajectory


class SimulatesRecords(Protocol):
    """What simulates N intervals, as `Stepper` does."""

    def simulate(self, x0: FloatArray, inputs: FloatArray, parameters: FloatArray, t0: float = 0.0) -> Trajectory:
        """States, outputs and signals."""
        ...

    def simulate_sensitivities(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray,
        wrt: Sequence[str],
        x0_gradient: FloatArray,
        t0: float = 0.0,
    ) -> Sensitivities:
        """Outputs with their derivatives."""
        ...


class RecordSimulator:
    """Free run of a model over records: outputs at every row, row 0 being the initial state itself.

    Parameters
    ----------
    model
        The model.
    dt
        Sampling interval of the records [s].
    nodes
        Rows of the one record to simulate; those between are interpolated. Default all.
    stepper
        What simulates all rows in the place of a `Stepper`.
    """

    def __init__(
        self, model: Model, dt: float, nodes: Nodes | None = None, stepper: SimulatesRecords | None = None
    ) -> None:
        self.model, self.nodes = model, nodes
        usual = Stepper(model, dt) if nodes is None else NodeStepper(model)
        self.stepper: SimulatesRecords = usual if stepper is None else stepper
        self._first = FastCall(model.derived(_first_row))

    def outputs(self, record: Dataset, x0: FloatArray, p: FloatArray) -> FloatArray:
        """Outputs (N, ny) of the free run from x0 (nx,) with parameters p (np,)."""
        run = self.stepper.simulate(x0, self._inputs(record), p, record.time[0])
        y0 = self._first(x0, record.time[0], record.inputs[0], p)[0]
        return self._spread(np.vstack([y0, run.outputs]))

    def first_outputs(self, record: Dataset, x0: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Outputs (ny,) at the first row, of the state x0 (nx,) itself, and their derivatives by it (ny, nx)."""
        y0, by_x, _ = self._first(x0, record.time[0], record.inputs[0], p)
        return np.ravel(y0), by_x.reshape(y0.size, -1)

    def states(self, record: Dataset, x0: FloatArray, p: FloatArray) -> FloatArray:
        """States (K, nx) of the free run at the rows, or nodes, after the first."""
        run = self.stepper.simulate(x0, self._inputs(record), p, float(record.time[0]))
        return np.asarray(run.states, dtype=np.float64)

    def last_state(self, record: Dataset, x0: FloatArray, p: FloatArray) -> FloatArray:
        """State (nx,) at the last row of the free run."""
        last: FloatArray = self.states(record, x0, p)[-1].copy()
        return last

    def sensitivities(
        self, record: Dataset, x0: FloatArray, p: FloatArray, wrt: Sequence[str], x0_gradient: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Outputs (N, ny) with exact derivatives (N, ny, q), and those of the last state (nx, q).

        See `Stepper.simulate_sensitivities` for q.
        """
        tail = self.stepper.simulate_sensitivities(x0, self._inputs(record), p, wrt, x0_gradient, record.time[0])
        y0, by_x, by_p = self._first(x0, record.time[0], record.inputs[0], p)
        first = by_x.reshape(y0.size, -1) @ x0_gradient
        first[:, : len(wrt)] += by_p.reshape(y0.size, -1)[:, self.model.indices("parameters", wrt)]
        outputs, gradient = np.vstack([y0, tail.outputs]), np.concatenate([first[None], tail.gradient])
        return self._spread(outputs), self._spread(gradient), tail.last_state_gradient

    def _inputs(self, record: Dataset) -> FloatArray:
        return record.inputs[1:] if self.nodes is None else self.nodes.inputs

    def _spread(self, values: FloatArray) -> FloatArray:
        return values if self.nodes is None else self.nodes.spread(values)


def _first_row(model: Model) -> ca.Function:
    """`(x, t, u, p) -> (y, dy_dx, dy_dp)` at one instant."""
    t, x, u, p = model.ode.sx_in()
    y = model.ode(t, x, u, p)[1]
    return ca.Function("first_row", [x, t, u, p], [y, ca.jacobian(y, x), ca.jacobian(y, p)])
