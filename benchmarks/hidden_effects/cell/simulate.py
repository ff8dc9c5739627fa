"""Integrate the cell with SciPy's LSODA from one held input to the next; samples each whole second.

Row k of what comes out belongs to time k: the inputs are those held during the second that ends there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint
from scipy.optimize import brentq

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.equations import Instant, Signals, World, evaluate, froth
from benchmarks.hidden_effects.cell.sites import SITES

Array = NDArray[np.float64]
RTOL = 3e-7
_SCALE = (1e-4, 0.1, 1e-2, 1e-2, 1e-2, 1e-2, 1e-2, 0.1, 10.0)  # of the nominal states, for the absolute tolerance


class SimulationError(Exception):
    """The cell left the range in which it means anything, or the integrator gave up."""


@dataclass
class Simulation:
    """A cell in time: `advance` moves it; outputs are gathered a row a second."""

    world: World
    state: list[float]
    time: float = 0.0
    memory: list[list[float]] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.memory:
            self.memory = [list(i.start) if i.tick else [] for i in self.world.influences]

    def advance(self, seconds: int, u: Sequence[float]) -> None:
        """Hold u for a whole number of seconds and store a row at the end of each.

        Raises
        ------
        SimulationError
            No overflow, level outside the cell, or no convergence.
        """
        ticking = any(influence.tick for influence in self.world.influences)
        left = seconds
        while left:
            piece = 1 if ticking else left
            for instant in self._hold(piece, u):
                self.rows.append(_row(u, instant))
            left -= piece
            if ticking:
                self._tick(u)

    def _hold(self, seconds: int, u: Sequence[float]) -> list[Instant]:
        t = self.time + np.arange(seconds + 1, dtype=float)
        path = self._integrate(t, u)
        self.state, self.time = path[-1].tolist(), float(t[-1])
        if not 0.05 < self.state[1] < c.CELL_HEIGHT - 0.005:
            raise SimulationError(f"t = {self.time:.0f} s: level {self.state[1]:.3f} m")
        rows = zip(t[1:].tolist(), path[1:].tolist(), strict=True)
        return [evaluate(time, x, u, self.world, self.memory) for time, x in rows]

    def _integrate(self, t: Array, u: Sequence[float]) -> Array:
        """States at the times t, from the state now; LSODA."""
        scale = _SCALE if len(self.state) <= len(_SCALE) else (*_SCALE, *(abs(v) for v in self.state[len(_SCALE) :]))
        atol = [0.1 * RTOL * (s or 1e-3) for s in scale]
        world, memory = self.world, self.memory

        def rates(time: float, x: Array) -> list[float]:
            return evaluate(time, x.tolist(), u, world, memory).rates

        try:
            solution: Any = odeint(  # type: ignore[call-overload]
                rates, self.state, t, tfirst=True, rtol=RTOL, atol=atol, full_output=True, printmessg=False, mxstep=5000
            )
        except (ValueError, ZeroDivisionError, OverflowError, TypeError) as error:
            raise SimulationError(f"t = {self.time:.0f} s: {error}") from error
        path, info = solution
        if info["message"] != "Integration successful.":
            raise SimulationError(f"t = {self.time:.0f} s: {info['message']}")
        return np.asarray(path, dtype=np.float64)

    def _tick(self, u: Sequence[float]) -> None:
        signals = evaluate(self.time, self.state, u, self.world, self.memory).signals
        for influence, held in zip(self.world.influences, self.memory, strict=True):
            if influence.tick:
                influence.tick(self.time, signals, held)

    def settle(self, u: Sequence[float], seconds: float = 2400.0) -> None:
        """Hold u until transients are gone; the clock then shows what it showed before."""
        self.state = self._integrate(np.array([self.time - seconds, self.time]), u)[-1].tolist()


ROW = ("level_m", "tails_flow_m3_s", "concentrate_grade", "air_recovery", "concentrate_flow_m3_s", "recovery",
       "alpha_star", "true_level", *Signals._fields[:7])  # fmt: skip


def _row(u: Sequence[float], z: Instant) -> tuple[float, ...]:
    s = z.signals
    return (z.level_measured, z.tails_flow, z.grade, z.air_recovery, z.froth.q_concentrate, z.recovery, z.froth.alpha,
            s.level, u[0], u[1], s.level, s.froth_depth, z.grade, s.solids, s.valuable_solids)  # fmt: skip


def steady_state(u: Sequence[float], world: World) -> list[float]:
    """State of the cell without its effects at rest under u: gas in = gas out for each class, then the masses."""
    j_g = u[0] / c.AREA
    eps = [
        float(brentq(lambda e, v=v, p=p: v * e * (1.0 - e) ** -1.39 - j_g * p, 0.0, 0.9, xtol=1e-15))
        for v, p in zip(c.STOKES, c.AIR_SHARES, strict=True)
    ]
    r = [e / (1.0 - sum(eps)) for e in eps]
    q_tails = u[1]
    for _ in range(60):
        z = froth(u[0], u[1], q_tails, u[2], r, (world.n, world.C), [1.0] * len(SITES))
        q_tails = u[1] - z.q_concentrate
    state = [q_tails - c.LEVEL_GAIN * u[2], u[2], *r]
    volume = c.AREA * u[2]
    masses = [p.feed * volume for p in world.populations]
    state += [(1.0 - world.dead_share) * m for m in masses]
    if world.dead_share:
        state += [world.dead_share * m for m in masses]
    for influence in world.influences:
        state += [] if influence.tick else influence.start
    return state


def table(simulation: Simulation) -> dict[str, Array]:
    """Columns of `ROW` gathered so far, (N,) each."""
    columns = np.array(simulation.rows, dtype=np.float64).reshape(len(simulation.rows), len(ROW)).T
    return dict(zip(ROW, columns, strict=True))


def replay(world: World, inputs: Array, start: Sequence[float], time: float = 0.0) -> dict[str, Array]:
    """Hold each row of inputs (N, 3) for a second from the nominal core state `start`; columns as of `table`.

    Equal rows in a row are one call of the integrator. States of effects start at their own start values.
    """
    extra = [v for influence in world.influences if not influence.tick for v in influence.start]
    simulation = Simulation(world, [*start, *extra], time)
    changes = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0.0, axis=1)) + 1
    for first, last in zip([0, *changes], [*changes, len(inputs)], strict=True):
        simulation.advance(int(last - first), inputs[first].tolist())
    return table(simulation)
