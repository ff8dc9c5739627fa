"""Simulation of many members of a model, each with its own state, inputs and parameters."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.function_cache import FunctionCache
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping import step_functions
from adaptive_flot.greybox.stepping.step_functions import Interval
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import InstructionSet

What = Literal["states", "outputs", "signals"]
_MATRICES = ("S", "S_next", "dy")
_RESULTS: dict[What, str] = {"states": "x_next", "outputs": "y", "signals": "s"}


@dataclass(frozen=True)
class EnsembleRun:
    """Simulated records of M members, N rows each, every row at the end of an interval.

    Attributes
    ----------
    time
        Time of each row [s] (N,).
    states, outputs, signals
        Their values (M, N, nx), (M, N, ny) and (M, N, ns), in the model's units; empty (M, 0, n) where not kept.
    last_state
        State at the end (M, nx).
    """

    time: FloatArray
    states: FloatArray
    outputs: FloatArray
    signals: FloatArray
    last_state: FloatArray


@dataclass(frozen=True)
class EnsembleSensitivities:
    """Simulated records of M members and their derivatives for q unknowns.

    Attributes
    ----------
    outputs, gradient
        Outputs (M, N, ny) and their derivatives (M, N, ny, q).
    last_state, last_state_gradient
        State at the end (M, nx) and its derivatives (M, nx, q).
    """

    outputs: FloatArray
    gradient: FloatArray
    last_state: FloatArray
    last_state_gradient: FloatArray


class Ensemble:
    """The map over one sampling interval of a model for many members, the same as `Stepper` for each of them.

    Its functions are machine code where the model asks for it (`Model.compiled`), eight members at once with AVX-512.
    They agree with the plain step to rounding (1e-12). A member that leaves the model shows as NaN; the others go on.

    Parameters
    ----------
    model
        The grey-box model.
    dt
        Sampling interval [s].
    substeps
        Steps an interval of the fast method; default as many as the model's `max_step_s` asks for.
    instructions
        Instruction set of the machine code; default the widest of this machine.

    Raises
    ------
    ModelError
        `dt` or `substeps` is not positive.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        *,
        substeps: int | None = None,
        instructions: InstructionSet | None = None,
    ) -> None:
        if not (np.isfinite(dt) and dt > 0 and (substeps is None or substeps >= 1)):
            raise ModelError(f"an ensemble needs dt > 0 and substeps >= 1, got dt = {dt}, substeps = {substeps}")
        self.model, self.dt = model, float(dt)
        count = substeps or model.steps_in(dt)
        # steps too many for one function are rows of their own, as in `Stepper`
        self._rows_each = count if count > MOST_UNROLLED else 1
        self._interval = Interval(self.dt / self._rows_each, count // self._rows_each)
        self._instructions = instructions
        self._lanes: FunctionCache[Lanes] = FunctionCache()

    def step(
        self, x: FloatArray, time: float, inputs: FloatArray, parameters: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """State (M, nx), outputs (M, ny) and signals (M, ns) one interval on.

        Parameters
        ----------
        x, time
            States (M, nx) at the start of the interval, and its time [s].
        inputs, parameters
            Of each member, (M, nu) and (M, np), or the same for all, (nu,) and (np,).
        """
        u = np.asarray(inputs, dtype=float)
        run = self.simulate(x, u[:, None] if u.ndim == 2 else u[None], parameters, time)
        return run.last_state, run.outputs[:, 0], run.signals[:, 0]

    def simulate(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray | None = None,
        t0: float = 0.0,
        *,
        keep: Collection[What] = ("states", "outputs", "signals"),
    ) -> EnsembleRun:
        """Simulate N intervals. At least one of the first three arguments says how many members there are.

        Parameters
        ----------
        x0, t0
            States at the start of the first interval, (M, nx), or (nx,) for all; its time [s].
        inputs
            Inputs held in each interval, (M, N, nu), or (N, nu) for all.
        parameters
            Parameters (M, np), or (np,) for all, or (M, N, np), one vector a row; default the model's values.
        keep
            What is kept of every row: a thousand members of 2400 rows take 20 megabytes for each number of a row.

        Raises
        ------
        ModelError
            Shapes that do not fit the model or each other.
        """
        x, u, p, t, members = self._tables(x0, inputs, parameters, t0)
        rows, each = u.shape[-2], self._rows_each
        fixed: dict[str, FloatArray] = {"x": x}
        by_row = {"t": t, "u": self._each_step(u)}
        if p.ndim == 3:
            by_row["p"] = self._each_step(p)
        else:
            fixed["p"] = p
        lanes = self._lanes.get("step", lambda: self._made(step_functions.step, {"x": "x_next"}))
        every = [_RESULTS[what] for what in keep]
        last = [] if "x_next" in every else ["x_next"]
        found = lanes(members, rows * each, fixed, by_row, every=every, last=last)
        counts = (len(q) for q in (self.model.states, self.model.outputs, self.model.signals))
        states, outputs, signals = (
            found[name][:, each - 1 :: each] if what in keep else np.empty((members, 0, count))
            for (what, name), count in zip(_RESULTS.items(), counts, strict=True)
        )
        end = found["x_next"] if last else states[:, -1]
        time = t0 + self.dt * np.arange(1, rows + 1, dtype=float)
        return EnsembleRun(time, states, outputs, signals, end)

    def simulate_sensitivities(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray,
        wrt: Sequence[str],
        x0_gradient: FloatArray,
        t0: float = 0.0,
    ) -> EnsembleSensitivities:
        """Simulate N intervals with exact derivatives of the outputs for q unknowns; see `Stepper`.

        `x0_gradient` is (nx, q) for all members, or (M, nx, q). The other arguments are those of `simulate`, without
        parameters that change from row to row.
        """
        x, u, p, t, members = self._tables(x0, inputs, parameters, t0)
        if p.ndim == 3:
            raise ModelError("sensitivities need one parameter vector for the whole record, got one a row")
        gradient = np.asarray(x0_gradient, dtype=float)
        q, each = gradient.shape[-1], self._rows_each
        lanes = self._lanes.get(
            (tuple(wrt), q),
            lambda: self._made(
                step_functions.sensitivity_step, {"x": "x_next", "S": "S_next"}, tuple(wrt), q, matrices=_MATRICES
            ),
        )
        fixed = {"x": x, "p": p, "S": gradient}
        by_row = {"t": t, "u": self._each_step(u)}
        found = lanes(members, u.shape[-2] * each, fixed, by_row, every=["y", "dy"], last=["x_next", "S_next"])
        rows = slice(each - 1, None, each)
        return EnsembleSensitivities(found["y"][:, rows], found["dy"][:, rows], found["x_next"], found["S_next"])

    def _each_step(self, rows: FloatArray) -> FloatArray:
        """What is held in each interval (..., N, n), for each of its steps."""
        return rows if self._rows_each == 1 else np.repeat(rows, self._rows_each, axis=-2)

    def _made(
        self,
        builder: Callable[..., ca.Function],
        carried: dict[str, str],
        *more: object,
        matrices: Collection[str] = (),
    ) -> Lanes:
        function = self.model.derived(builder, self._interval, *more)
        quick = self.model.compiled
        return Lanes(function, carried, matrices, as_machine_code=quick, instructions=self._instructions)

    def _tables(
        self, x0: FloatArray, inputs: FloatArray, parameters: FloatArray | None, t0: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]:
        """State, inputs, parameters, times (rows, 1) of all steps, and the number of members."""
        x, u = np.asarray(x0, dtype=float), np.asarray(inputs, dtype=float)
        p = self.model.parameter_values if parameters is None else np.asarray(parameters, dtype=float)
        if not (x.ndim in (1, 2) and u.ndim in (2, 3) and p.ndim in (1, 2, 3)):
            raise ModelError(
                f"an ensemble takes states (M, nx), inputs (M, N, nu) and parameters (M, np), each also without M; "
                f"got {x.shape}, {u.shape} and {p.shape}"
            )
        counts = {len(x)} if x.ndim == 2 else set()
        counts |= ({len(u)} if u.ndim == 3 else set()) | ({len(p)} if p.ndim > 1 else set())
        if len(counts) != 1:
            said = f"{sorted(counts)} members" if counts else "nothing says how many members"
            raise ModelError(f"states {x.shape}, inputs {u.shape} and parameters {p.shape}: {said}; give one number")
        if not u.shape[-2]:
            raise ModelError("an ensemble takes at least one interval, got inputs without rows; give some")
        steps = u.shape[-2] * self._rows_each
        return x, u, p, (t0 + self.dt / self._rows_each * np.arange(steps, dtype=float))[:, None], counts.pop()
