"""The flotation cell in plain Python: right-hand side and outputs, every site a factor that is 1 in the nominal model.

States ``x``: I [m3/s] (integral part of the level loop, Q_tails asked = k_p h_measured + I), h_p [m], r_1 .. r_5 [-],
then one mass [kg] a mineral population, then one a population in the dead volume (if there is one), then what effects
add. The loop in position form is the paper's velocity form integrated once. Inputs ``u``: Q_air, Q_feed [m3/s], h_p
set-point [m]. Equation numbers: part I of Quintanilla et al. (2021).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.sites import INDEX, SITES

N_GAS = 7  # I, h_p, r_1 .. r_5
_K_BUBBLES = range(5)
_AIR, _FEED, _FEED_GRADE, _BUBBLE, _SLIP, _BURST, _COALESCENCE, _EXPONENT, _RECOVERY, _ENTRAINMENT, _SETTLING = range(
    11
)
_CONCENTRATE, _FLOAT_1, _FLOAT_2, _VALVE = range(11, 15)
_LEVEL_SENSOR, _DRAINAGE = INDEX["level_sensor"], INDEX["film_drainage"]
Two = tuple[float, float]  # chalcopyrite, quartz
_NOMINAL = [1.0] * len(SITES)
_AXIAL = math.sqrt(math.sqrt(3.0) - math.pi / 2.0)


class Population(NamedTuple):
    """Particles that float alike: feed concentration [kg/m3], floatability [-], 0 = chalcopyrite or 1 = quartz."""

    feed: float
    floatability: float
    mineral: int


POPULATIONS = tuple(
    Population(f, p, i) for i, (f, p) in enumerate(zip(c.FEED_CONCENTRATIONS, c.FLOATABILITY, strict=True))
)


@dataclass(frozen=True)
class Structure:
    """What no listed site has: other populations of particles, feed that bypasses, a dead volume."""

    populations: tuple[Population, ...] = POPULATIONS
    bypass: float = 0.0
    dead_share: float = 0.0
    exchange_flow: float = 0.0


class Signals(NamedTuple):
    """What an effect may depend on, at one instant; first the `sites.STATE_DRIVERS` (grade: NaN, see `Influence`)."""

    air_flow: float
    feed_flow: float
    level: float
    froth_depth: float
    grade: float
    solids: float
    valuable_solids: float
    tails_asked: float = math.nan


@dataclass(frozen=True)
class Influence:
    """One factor at one site: multiplier(t, signals, own states), and the equations of its own states.

    `rates(t, signals, own, grade)` returns their derivatives. `tick(t, signals, memory)` is called each whole second
    and changes the list `memory` (held between), which the multiplier sees in place of its own states.
    """

    site: int
    multiplier: Callable[[float, Signals, Sequence[float]], float]
    start: tuple[float, ...] = ()
    rates: Callable[[float, Signals, Sequence[float], float], Sequence[float]] | None = None
    tick: Callable[[float, Signals, list[float]], None] | None = None


@dataclass(frozen=True)
class World:
    """The cell of one record: n, C, what acts on it, and structure that no listed site has."""

    n: float = c.GROWTH_EXPONENT
    C: float = c.COALESCENCE_RATE
    influences: tuple[Influence, ...] = ()
    populations: tuple[Population, ...] = POPULATIONS
    bypass: float = 0.0  # share of the feed that goes straight to the tails
    dead_share: float = 0.0  # share of the pulp volume that only exchanges ...
    exchange_flow: float = 0.0  # ... with the rest, m3/s

    @cached_property
    def n_core(self) -> int:
        """Number of states before those of the effects."""
        return N_GAS + len(self.populations) * (2 if self.dead_share else 1)

    @cached_property
    def valuable(self) -> tuple[int, ...]:
        """Which populations are chalcopyrite."""
        return tuple(k for k, p in enumerate(self.populations) if p.mineral == 0)

    @cached_property
    def valuable_feed(self) -> float:
        """Their feed concentration in all [kg/m3]."""
        return sum(self.populations[k].feed for k in self.valuable)

    @cached_property
    def valve_acts(self) -> bool:
        """Whether an effect is at the tails valve."""
        return any(i.site == _VALVE for i in self.influences)


class Froth(NamedTuple):
    """Algebraic quantities of gas and froth at one instant."""

    v_gas: float  # v_g*, m/s
    v_out: float  # m/s
    alpha: float  # alpha*
    d_interface: float  # m
    d_top: float  # m
    q_concentrate: float  # m3/s
    flux: list[float]  # v_k eps_k, m/s


def froth(q_air: float, q_feed: float, q_tails: float, h_p: float, r: Sequence[float], theta: tuple[float, float],
          f: Sequence[float]) -> Froth:  # fmt: skip
    """Solve v_g* (one algebraic equation, by secants) and evaluate gas and froth; f holds a factor per site."""
    total = 1.0 + sum(r)
    size, slip = f[_BUBBLE], f[_SLIP] * f[_BUBBLE] ** 2
    flux = [0.0] * 5
    v_out = area_flux = 0.0
    for k in _K_BUBBLES:
        eps = r[k] / total
        flux[k] = w = slip * c.STOKES[k] * (1.0 - eps) ** -1.39 * eps
        v_out += w
        area_flux += w / c.BUBBLE_DIAMETERS[k]
    d_int = size * v_out / area_flux
    j_g = q_air / c.AREA
    v_burst = f[_BURST] * (c.BURST[0] + c.BURST[1] * j_g + c.BURST[2] * j_g * j_g)
    v_max = (q_feed - q_tails + q_air) / c.AREA
    n, rate = theta[0] * f[_EXPONENT], theta[1] * f[_COALESCENCE]
    growth, start = n * rate * (c.CELL_HEIGHT - h_p), d_int**n
    gain = f[_CONCENTRATE] * c.PLATEAU_BORDER / (f[_DRAINAGE] * c.FILM_DRAINAGE)

    def overflow(v: float) -> tuple[float, float, float]:
        """Q_conc / A, alpha* and d_froth at the gas velocity v."""
        alpha = 1.0 - v_burst / v
        d_top = (growth / v + start) ** (1.0 / n)
        if alpha <= 0.0:
            return 0.0, 0.0, d_top
        w = 1.0 / (1.0 + math.exp(-50.0 * (alpha - 0.5)))
        return gain * v * v * ((1.0 - w) * alpha * (1.0 - alpha) + 0.25 * w) / (d_top * d_top), alpha, d_top

    v_old, (q_old, alpha, d_top) = v_max, overflow(v_max)
    v, q = v_max - q_old, q_old
    for _ in range(30):
        q, alpha, d_top = overflow(v)
        error, error_old = v - v_max + q, v_old - v_max + q_old
        if abs(error) <= 1e-14 or error == error_old:
            break
        v_old, q_old, v = v, q, v - error * (v - v_old) / (error - error_old)
    return Froth(v, v_out, alpha, d_int, d_top, c.AREA * q, flux)


def transport(z: Froth, q_air: float, depth: float, f: Sequence[float]) -> tuple[Two, Two]:
    """V_cell S_b R_f,i, to be multiplied by a floatability, and Q_conc R_ent,i [m3/s] (paper; part I, 53-58)."""
    w = 1.0 / (1.0 + math.exp(-50.0 * (z.alpha - 0.5)))
    bubbles = f[_RECOVERY] * c.CELL_VOLUME * 6.0 * z.v_gas / z.d_interface * math.sqrt(z.d_interface / z.d_top)
    axial = (q_air / c.AREA) ** 1.5 / (math.sqrt(f[_DRAINAGE] * c.FILM_DRAINAGE) * _AXIAL * c.PECLET)
    below, above = z.alpha * (1.0 - z.alpha) * z.v_gas, 0.25 * z.v_gas
    slow, fast = math.sqrt(z.v_gas * (1.0 - z.alpha)), 0.5 * math.sqrt(z.v_gas)
    float_1, float_2, drag_1, drag_2 = 0.0, 0.0, 0.0, 0.0
    for i in (0, 1):
        v_set = f[_SETTLING] * c.SETTLING[i]
        drop = v_set**1.5 * depth / axial
        rate = bubbles * ((1.0 - w) * (below / v_set) ** 0.25 + w * (above / v_set) ** 0.25)
        drag = f[_ENTRAINMENT] * z.q_concentrate * ((1.0 - w) * math.exp(-drop / slow) + w * math.exp(-drop / fast))
        if i == 0:
            float_1, drag_1 = rate * f[_FLOAT_1], drag
        else:
            float_2, drag_2 = rate * f[_FLOAT_2], drag
    return (float_1, float_2), (drag_1, drag_2)


class Instant(NamedTuple):
    """Everything at one time: derivatives and outputs (level and tails flow as they are, not as measured)."""

    rates: list[float]
    grade: float
    recovery: float
    air_recovery: float
    level_measured: float
    tails_flow: float
    froth: Froth
    signals: Signals
    factors: list[float]


def evaluate(t: float, x: Sequence[float], u: Sequence[float], world: World, memory: Sequence[list[float]]) -> Instant:
    """Evaluate the cell at time t [s], states x, inputs u; memory: a list per influence (empty where it has none)."""
    core, populations = world.n_core, world.populations
    count = len(populations)
    h_p, r, masses = x[1], x[2:N_GAS], x[N_GAS : N_GAS + count]
    depth = c.CELL_HEIGHT - h_p
    volume = (1.0 - world.dead_share) * c.AREA * h_p
    valuable = sum([masses[k] for k in world.valuable]) / volume
    signals = Signals(u[0], u[1], h_p, depth, math.nan, sum(masses) / volume, valuable)
    f, own = _factors(t, x[core:], signals, world, memory)
    q_air, q_feed = u[0] * f[_AIR], u[1] * f[_FEED]
    h_measured = h_p * f[_LEVEL_SENSOR]
    asked = c.LEVEL_GAIN * h_measured + x[0]
    if world.valve_acts and f[_VALVE] == 1.0:  # a valve effect needs what is asked
        signals = signals._replace(tails_asked=asked)
        f, own = _factors(t, x[core:], signals, world, memory)
    q_tails = asked * f[_VALVE]
    z = froth(q_air, q_feed, q_tails, h_p, r, (world.n, world.C), f)
    floated, entrained = transport(z, q_air, depth, f)
    rates = [c.LEVEL_GAIN / c.LEVEL_INTEGRAL_TIME * (h_measured - u[2]), z.v_gas - z.v_out]
    total, net, pulp = 1.0 + sum(r), q_feed - q_tails - z.q_concentrate, c.AREA * h_p
    rates += [total / pulp * (q_air * c.AIR_SHARES[k] - c.AREA * z.flux[k] - net * r[k]) for k in _K_BUBBLES]
    leave, passing = q_tails - world.bypass * q_feed, (1.0 - world.bypass) * q_feed
    concentrate = [0.0, 0.0]
    for m, p in zip(masses, populations, strict=True):
        taken = m / volume * (p.floatability * floated[p.mineral] + entrained[p.mineral])
        concentrate[p.mineral] += taken
        feed = p.feed * (f[_FEED_GRADE] if p.mineral == 0 else 1.0)
        rates.append(feed * passing - m / volume * leave - taken)
    if world.dead_share:
        _exchange(rates, x, world, pulp)
    grade = concentrate[0] / (concentrate[0] + concentrate[1])
    for influence, states in zip(world.influences, own, strict=True):
        if influence.rates is not None:
            rates += influence.rates(t, signals, states, grade)
    fed = world.valuable_feed * f[_FEED_GRADE] * q_feed
    air_recovery = z.alpha * z.v_gas * c.AREA / q_air
    return Instant(rates, grade, concentrate[0] / fed, air_recovery, h_measured, q_tails, z, signals, f)


def _factors(t: float, extra: Sequence[float], signals: Signals, world: World, memory: Sequence[list[float]]
             ) -> tuple[list[float], list[Sequence[float]]]:  # fmt: skip
    """Product of the multipliers of each site, and the slice of own states of each influence."""
    if not world.influences:
        return _NOMINAL, []
    f, own, at = [1.0] * len(SITES), [], 0
    for influence, held in zip(world.influences, memory, strict=True):
        states: Sequence[float] = held or extra[at : at + len(influence.start)]
        at += 0 if held else len(influence.start)
        own.append(states)
        f[influence.site] *= influence.multiplier(t, signals, states)
    return f, own


def _exchange(rates: list[float], x: Sequence[float], world: World, pulp: float) -> None:
    """Exchange between the stirred and the dead part of the pulp: add to the rates of both."""
    count = len(world.populations)
    for i in range(count):
        stirred = x[N_GAS + i] / ((1.0 - world.dead_share) * pulp)
        dead = x[N_GAS + count + i] / (world.dead_share * pulp)
        flow = world.exchange_flow * (stirred - dead)
        rates[N_GAS + i] -= flow
        rates.append(flow)
