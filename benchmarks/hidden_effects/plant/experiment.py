"""One experiment: a plan of moves or a controller, noise, effects; run it with or without them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.equations import N_GAS, Structure, World, evaluate
from benchmarks.hidden_effects.cell.simulate import ROW, Array, Simulation, SimulationError, replay, steady_state
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects.spec import Spec, influence
from benchmarks.hidden_effects.plant import control
from benchmarks.hidden_effects.plant.noise import MeasurementNoise
from benchmarks.hidden_effects.plant.sensors import Instruments

SMALLEST_ALPHA = 0.02  # froth that hardly overflows is outside the model


@dataclass(frozen=True)
class Experiment:
    """Everything of a record but its effects. Rows before the record (burn) let it start anywhere."""

    rows: int
    burn: int
    n: float
    C: float
    loop: str  # "open" or a kind of control
    moves: Array  # (burn + rows, 3): inputs in open loop; grade reference, feed flow, level set-point in closed loop
    controller_seed: int
    noise: MeasurementNoise
    outputs: tuple[str, ...]  # the measured ones


@dataclass(frozen=True)
class SimulatedRun:
    """What an experiment gave, the rows before the record left out."""

    inputs: Array  # (rows, 3)
    truth: dict[str, Array]  # columns of `simulate.ROW`, as they are
    clean: dict[str, Array]  # outputs through the sensors, without noise
    noisy: dict[str, Array]
    start: list[float]  # nominal core state before the first row


def build_world(experiment: Experiment, specs: Sequence[Spec], first: Sequence[float],
                structure: Structure | None = None) -> World:  # fmt: skip
    """The cell with its effects compiled."""
    influences = tuple(influence(s, first) for s in specs if s.in_equations)
    s = structure or Structure()
    return World(experiment.n, experiment.C, influences, s.populations, s.bypass, s.dead_share, s.exchange_flow)


def _first_inputs(experiment: Experiment) -> list[float]:
    move = experiment.moves[0]
    return [1.5e-3, float(move[1]), float(move[2])] if experiment.loop != "open" else move.tolist()


def run(experiment: Experiment, specs: Sequence[Spec] = (), structure: Structure | None = None) -> SimulatedRun:
    """Run the experiment.

    Raises
    ------
    SimulationError
        The cell leaves its range, or its froth hardly overflows.
    """
    first = _first_inputs(experiment)
    world = build_world(experiment, specs, first, structure)
    simulation = Simulation(world, steady_state(first, world), float(-experiment.burn))
    simulation.settle(first)
    noise = experiment.noise
    instruments = Instruments(specs, noise.values, noise.proportional, noise.step)
    start = _nominal_start(simulation, world, first) if not experiment.burn else []
    driver = _open if experiment.loop == "open" else _closed
    for hold, inputs in driver(experiment, instruments):
        done = len(simulation.rows)
        while hold:  # stop once at the start of the record, to keep the state there
            piece = min(hold, experiment.burn - done) if done < experiment.burn else hold
            simulation.advance(piece, inputs)
            hold, done = hold - piece, done + piece
            if done == experiment.burn:
                start = _nominal_start(simulation, world, inputs)
        for row in simulation.rows[len(instruments.clean) :]:
            k = len(instruments.clean)
            instruments.measure(float(k + 1 - experiment.burn), dict(zip(ROW, row, strict=True)))
    return _gather(experiment, simulation, instruments, start)


def _open(experiment: Experiment, instruments: Instruments) -> Iterator[tuple[int, list[float]]]:
    """Seconds to hold and inputs, one after the other, as planned."""
    moves = experiment.moves
    changes = np.flatnonzero(np.any(np.diff(moves, axis=0) != 0.0, axis=1)) + 1
    for first, last in zip([0, *changes], [*changes, len(moves)], strict=True):
        yield int(last - first), moves[first].tolist()


def _closed(experiment: Experiment, instruments: Instruments) -> Iterator[tuple[int, list[float]]]:
    """Seconds to hold and inputs, as the controller decides from the measured grade."""
    controller = control.make(experiment.loop, np.random.default_rng(experiment.controller_seed))
    moves, k = experiment.moves, 0
    at = OUTPUTS.index("concentrate_grade")
    while k < len(moves):
        hold = min(controller.every, len(moves) - k)
        air = controller.air
        if k:
            grade = float(np.mean([row[at] for row in instruments.noisy[-controller.every :]]))
            air = controller.decide(grade, float(moves[k, 0]), float(moves[k - 1, 2]))
        yield hold, [air, float(moves[k, 1]), float(moves[k, 2])]
        k += hold


def _nominal_start(simulation: Simulation, world: World, inputs: Sequence[float]) -> list[float]:
    """Nominal core state that is nearest to where the cell is: same level, gas, masses, and the tails flow it has."""
    z = evaluate(simulation.time, simulation.state, inputs, world, simulation.memory)
    x, p = simulation.state, world.populations
    masses = [sum(m for m, q in zip(x[N_GAS:], p, strict=False) if q.mineral == i) for i in (0, 1)]
    return [z.tails_flow - c.LEVEL_GAIN * x[1], *x[1:N_GAS], *(m / (1.0 - world.dead_share) for m in masses)]


def _gather(
    experiment: Experiment, simulation: Simulation, instruments: Instruments, start: list[float]
) -> SimulatedRun:
    rows = np.array(simulation.rows)[experiment.burn :]
    truth = dict(zip(ROW, rows.T, strict=True))
    if float(truth["alpha_star"].min()) < SMALLEST_ALPHA:
        raise SimulationError(f"alpha* falls to {truth['alpha_star'].min():.3f}")
    clean = dict(zip(OUTPUTS, np.array(instruments.clean)[experiment.burn :].T, strict=True))
    noisy = dict(zip(OUTPUTS, np.array(instruments.noisy)[experiment.burn :].T, strict=True))
    inputs = np.column_stack([truth["air_flow"], truth["feed_flow"], _setpoints(experiment)])
    return SimulatedRun(inputs, truth, clean, noisy, start)


def _setpoints(experiment: Experiment) -> Array:
    """Level set-point as it was held: moves in open loop, at the controller's ticks in closed loop."""
    column = experiment.moves[:, 2]
    if experiment.loop != "open":
        every = control.make(experiment.loop, np.random.default_rng(experiment.controller_seed)).every
        column = column[(np.arange(len(column)) // every) * every]
    return column[experiment.burn :]


def nominal(experiment: Experiment, done: SimulatedRun) -> dict[str, Array]:
    """Outputs of the nominal cell (same n and C, no effect) under the inputs of a run, from its start."""
    return replay(World(experiment.n, experiment.C), done.inputs, done.start)


def wander_spec(experiment: Experiment, rng: np.random.Generator) -> Spec | None:
    """Feed-grade wander of a record with noise of kind `process`; None for other kinds."""
    if not experiment.noise.feed_wander:
        return None
    count = int(experiment.rows / 45.0) + 2
    values = rng.standard_normal(count)
    every = experiment.rows / (count - 1)
    spec = Spec("feed_grade", "time", "wander", experiment.noise.feed_wander, story="noise of the feed")
    return replace(spec, parameters={"every": every, "values": [float(v) for v in values]})
