"""One sampling interval as one compiled function, with exact sensitivities; whole records in one call.

The functions are those of `step_functions.py`. The fast step (`fast_step.py`) is a Runge-Kutta method of order 4 on the
explicit right-hand side, with sensitivities that are exact for the map itself. The accurate step is IDAS (SUNDIALS) on
the index-1 DAE. Neither needs a compiler.

Time convention: the inputs of row k are held during the interval that ends at the time of row k, and states,
outputs and signals are those at that time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.function_cache import FunctionCache
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping import step_functions
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.rows import chunks
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.trajectory import Sensitivities, Trajectory
from adaptive_flot.greybox.stepping.whole_record.library import WholeRecord, whole_record

MOST_UNROLLED = 4
"""Substeps an interval up to which a whole record is run interval by interval. More are run one by one: a function of
ten of them, with derivatives, takes longer to make than a record takes to simulate."""
LEAST_STEPS, LEAST_IF_COMPILED = 20, 300
"""Steps from which a run is worth writing the tapes of `whole_record`, where the model asks for it. A function of so
many intervals takes longer to make. Of a compiled model the step is there, and shorter runs go by it."""


class Stepper:
    """The map over one sampling interval of a model.

    Parameters
    ----------
    model
        The grey-box model.
    dt
        Sampling interval [s].
    substeps
        Steps an interval of the fast method; default as many as the model's `max_step_s` asks for.
    accurate
        Integrate the DAE with IDAS at a relative tolerance of 1e-11 instead.

    Raises
    ------
    ModelError
        `dt` or `substeps` is not positive. Its functions of one interval refuse one of too many steps, see
        `step_functions.check_interval`; `simulate` and `simulate_sensitivities` take any.
    """

    def __init__(self, model: Model, dt: float, *, substeps: int | None = None, accurate: bool = False) -> None:
        if not (np.isfinite(dt) and dt > 0 and (substeps is None or substeps >= 1)):
            raise ModelError(f"a stepper needs dt > 0 and substeps >= 1, got dt = {dt}, substeps = {substeps}")
        self.model = model
        self.dt = float(dt)
        self.substeps = substeps or model.steps_in(dt)
        self.accurate = accurate
        self.interval = Interval(self.dt, self.substeps, accurate)
        self._calls: FunctionCache[FastCall] = FunctionCache()
        many = self.substeps > MOST_UNROLLED and not accurate
        self._single = Stepper(model, self.dt / self.substeps, substeps=1) if many else None

    @property
    def step(self) -> ca.Function:
        """`(x, t, u, p) -> (x_next, y, s)`: t [s] at the start of the interval, y and s at its end."""
        return self.model.derived(step_functions.step, self.interval)

    @cached_property
    def call(self) -> FastCall:
        """The step as a NumPy function `(x, t, u, p) -> (x_next, y, s)`."""
        return FastCall(self.model.derived(step_functions.ready_step, self.interval))

    def outputs_at(self, state: FloatArray, time: float, inputs: FloatArray, parameters: FloatArray) -> FloatArray:
        """Outputs and signals (ny + ns,) at one instant: the first row of a table."""
        _, y, s, _ = self.model.ode(time, state, inputs, parameters)
        return np.concatenate([np.array(y).ravel(), np.array(s).ravel()])

    def one_step_gradient(self, wrt: Sequence[str]) -> ca.Function:
        """Prediction one interval ahead with exact derivatives for q parameters.

        Returns `(x, t, u, p) -> (x_next (nx,), y (ny,), dy_dtheta (ny, q))`; x is held, as in the one-step predictor of
        the paper (Section IV-B).
        """
        return self.model.derived(step_functions.one_step_gradient, self.interval, tuple(wrt))

    def one_step_jacobians(self, wrt: Sequence[str]) -> ca.Function:
        """Return `(x, t, u, p) -> (x_next, y, dx_dx, dx_dtheta, dy_dx, dy_dtheta)`, exact, in forward mode."""
        return self.model.derived(step_functions.one_step_jacobians, self.interval, tuple(wrt))

    def simulate(
        self, x0: FloatArray, inputs: FloatArray, parameters: FloatArray | None = None, t0: float = 0.0
    ) -> Trajectory:
        """Simulate N intervals.

        Parameters
        ----------
        x0, t0
            State (nx,) at the start of the first interval, and its time [s].
        inputs
            Inputs held in each interval (N, nu).
        parameters
            Parameter vector (np,), or one a row (N, np); default the model's values.

        Returns
        -------
        Trajectory
            The N instants at the ends of the intervals. A state that leaves the model shows as NaN.
        """
        u, p, t = self._tables(inputs, parameters, t0)
        x = self._initial(x0)
        if self.accurate:
            return self._simulate_by_rows(x, u, p, t)
        quick = self.record_code(len(u), None)
        if quick is not None:
            found = quick(x, u, p, t0)
            return Trajectory(t + self.dt, found.states, found.outputs, found.signals)
        if self._single is not None:
            one_by_one = p if p.ndim == 1 else np.repeat(p, self.substeps, axis=0)
            run = self._single.simulate(x, np.repeat(u, self.substeps, axis=0), one_by_one, t0)
            ends = slice(self.substeps - 1, None, self.substeps)
            return Trajectory(t + self.dt, run.states[ends], run.outputs[ends], run.signals[ends])
        parts: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        by_row = np.tile(p, (len(u), 1)) if p.ndim == 1 else p
        for rows, count in chunks(len(u)):
            xs, ys, ss = self._steps(len(rows))(x[:, None], t[None, rows], u[rows].T, by_row[rows].T)
            parts.append((xs.T[:count], ys.T[:count], ss.T[:count]))
            x = parts[-1][0][-1]
        widths = (len(q) for q in (self.model.states, self.model.outputs, self.model.signals))
        xs, ys, ss = (np.vstack([np.empty((0, w)), *(part[i] for part in parts)]) for i, w in enumerate(widths))
        return Trajectory(t + self.dt, xs, ys, ss)

    def _simulate_by_rows(self, x: FloatArray, u: FloatArray, p: FloatArray, t: FloatArray) -> Trajectory:
        """Row by row, so that a failed integration ends in NaN and not in an exception."""
        widths = [len(q) for q in (self.model.states, self.model.outputs, self.model.signals)]
        xs, ys, ss = (np.full((len(u), w), np.nan) for w in widths)
        for k in range(len(u)):
            if not np.isfinite(x).all():
                break
            xs[k], ys[k], ss[k] = self.call(x, t[k], u[k], p if p.ndim == 1 else p[k])
            x = xs[k]
        return Trajectory(t + self.dt, xs, ys, ss)

    def simulate_sensitivities(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray,
        wrt: Sequence[str],
        x0_gradient: FloatArray,
        t0: float = 0.0,
    ) -> Sensitivities:
        """Simulate N intervals with d(outputs)/d(unknowns), exact for the map, propagated forward over the record.

        The q unknowns are the parameters `wrt`, followed by as many further ones as `x0_gradient` (nx, q) has
        columns beyond them (entries of the initial state, say).
        """
        u, p, t = self._tables(inputs, parameters, t0)
        if p.ndim != 1:
            raise ModelError("sensitivities need one parameter vector for the whole record, got one a row")
        quick = self.record_code(len(u), tuple(wrt))
        if quick is not None:
            start = np.asarray(x0_gradient, dtype=float).reshape(len(self._initial(x0)), -1)
            found = quick(self._initial(x0), u, p, t0, start)
            return Sensitivities(found.outputs, found.gradients, found.last_state, found.last_gradient)
        if self._single is not None:
            every = np.repeat(u, self.substeps, axis=0)
            all_steps = self._single.simulate_sensitivities(x0, every, p, wrt, x0_gradient, t0)
            ends = slice(self.substeps - 1, None, self.substeps)
            return replace(all_steps, outputs=all_steps.outputs[ends], gradient=all_steps.gradient[ends])
        x = self._initial(x0)
        gradient = np.asarray(x0_gradient, dtype=float).reshape(x.size, -1)
        q = gradient.shape[1]
        ys: list[FloatArray] = []
        dys: list[FloatArray] = []
        for rows, count in chunks(len(u)):
            held = np.tile(p[:, None], len(rows))
            steps = self._sensitivity_steps(tuple(wrt), q, len(rows))
            xs, gs, y, dy = steps(x[:, None], gradient, t[None, rows], u[rows].T, held)
            x, gradient = xs[:, count - 1], gs[:, (count - 1) * q : count * q]
            ys.append(y.T[:count])
            dys.append(dy.reshape(len(y), len(rows), q).transpose(1, 0, 2)[:count])
        return Sensitivities(np.vstack(ys), np.concatenate(dys), x, gradient)

    def record_code(self, rows: int, wrt: tuple[str, ...] | None) -> WholeRecord | None:
        """Machine code for a run of so many intervals, where the model asks for it and it is worth it."""
        least = LEAST_IF_COMPILED if self.model.compiled else LEAST_STEPS
        if not self.model.record_code or self.accurate or rows * self.substeps < least:
            return None
        return self.model.derived(whole_record, self.interval, wrt)

    def sensitivity_step(self, wrt: Sequence[str], unknowns: int | None = None) -> ca.Function:
        """The step with the sensitivity of the state carried along, exact for the map.

        Returns `(x, S (nx, q), t, u, p) -> (x_next, S_next (nx, q), y, dy (ny, q))` for q unknowns: the parameters
        `wrt`, followed by further ones that act through the state alone; default none.
        """
        q = len(wrt) if unknowns is None else unknowns
        return self.model.derived(step_functions.sensitivity_step, self.interval, tuple(wrt), q)

    def _steps(self, rows: int) -> FastCall:
        """The step for so many intervals in a row."""
        return self._calls.get(rows, lambda: _by_columns(self.model.derived(step_functions.steps, self.interval, rows)))

    def _sensitivity_steps(self, wrt: tuple[str, ...], unknowns: int, rows: int) -> FastCall:
        """The step with sensitivities for so many intervals in a row."""
        builder = step_functions.sensitivity_steps
        return self._calls.get(
            (wrt, unknowns, rows),
            lambda: _by_columns(self.model.derived(builder, self.interval, wrt, unknowns, rows)),
        )

    def _initial(self, x0: FloatArray) -> FloatArray:
        x = np.asarray(x0, dtype=float)
        if x.shape != (len(self.model.states),):
            raise ModelError(
                f"initial state has shape {x.shape}, model '{self.model.name}' ({len(self.model.states)},)"
            )
        return x

    def _input_columns(self) -> int:
        """Columns of the inputs; the step itself, slow to make where it is long, is not asked."""
        return len(self.model.inputs)

    def _tables(
        self, inputs: FloatArray, parameters: FloatArray | None, t0: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        u = np.atleast_2d(np.asarray(inputs, dtype=float))
        p = self.model.parameter_values if parameters is None else np.asarray(parameters, dtype=float)
        wanted = self._input_columns()
        if u.shape[1] != wanted:
            raise ModelError(f"inputs have {u.shape[1]} columns, model '{self.model.name}' {wanted}")
        if p.shape not in ((len(self.model.parameters),), (len(u), len(self.model.parameters))):
            raise ModelError(
                f"parameters have shape {p.shape}; give (np,) or (N, np), np = {len(self.model.parameters)}"
            )
        return u, p, t0 + self.dt * np.arange(len(u), dtype=float)


def _by_columns(function: ca.Function) -> FastCall:
    """A call whose arguments and results are all matrices, a column an interval."""
    return FastCall(function, [*function.name_in(), *function.name_out()])
