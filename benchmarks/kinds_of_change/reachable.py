"""What an estimator of drifts can reach: `python -m benchmarks.kinds_of_change.reachable`.

Each run is linearised along its true trajectory, after the first record. There the equations are linear, so that a
filter which is told how the parameters move is the best there is. Errors of the start and noise are drawn, the same
for each filter:

- *told when*: is told when each parameter turns, as the posterior Cramer-Rao bound is, but not where to;
- *told how*: knows that one parameter at a time drifts, or that both do, for the true mean duration; not when;
- *imm*, *adaptive_imm*: their modes and transitions, without what is for outliers, noise and errors of the model.

Prints root mean square errors of n / C over those of the one who is told when. The default seeds are those of
development. Errors of a few runs weigh most, so that a ratio needs many seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.progress import track as track_progress
from rich.table import Table

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.filtering.cramer_rao_bound import (
    LinearisedTrajectory,
    ParameterDrift,
    drift_of_time_profile,
    posterior_cramer_rao_bound,
    random_walk,
)
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.results.cramer_rao_limit import TrueRun
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario
from benchmarks.kinds_of_change.linear_bank import Motions, World, track
from benchmarks.kinds_of_change.truths import TRUTHS
from estimators.adaptive_imm import AdaptiveImm
from estimators.imm import Imm
from estimators.imm.modes import transitions
from estimators.shared.coordinates import Coordinates

DRAWS = 8
ROWS = ("paper", "both_ramp", "opposite_ramps", "ramps_down", "walk")
TOGETHER = ("both_ramp", "opposite_ramps")
RAMP_S, RAMP_PER_HOUR, SHARE_PER_HOUR = {"paper": 600.0, "ramps_down": 600.0}, 1.2, 0.1


@dataclass(frozen=True)
class Truth:
    """A run, linearised after its first record: its world, and how its parameters move."""

    world: World
    drift: ParameterDrift


def truth(scenario: Scenario, seed: int, *, walks: bool) -> Truth:
    """The run of a seed; parameters are in units of their nominal values, states of what is known of them."""
    run = TrueRun(Realisation(scenario, seed), Realisation(scenario, seed).schedule)
    first, nx, q = scenario.initial_rows, len(scenario.plant_model.states), len(scenario.setup.parameters)
    output = scenario.plant_model.index("outputs", scenario.setup.outputs[0])
    nominal, noise = run.adapted[0], run.noise({})
    record = LinearisedTrajectory(run.linear.F[:first], run.linear.H[:first])
    still = random_walk(first, np.zeros(q))
    known = posterior_cramer_rao_bound(record, still, noise[:first], run.first_covariance)[-1]
    spread = np.sqrt(np.diag(known)[:nx])
    unit = np.concatenate([np.where(spread > 0, spread, 1.0), nominal])
    c = run.adapted / nominal
    drift = random_walk(len(c), np.full(q, SHARE_PER_HOUR / 60.0)) if walks else drift_of_time_profile(c)
    world = World(
        run.linear.F[first:] * unit / unit[:nx, None],
        run.linear.H[first:, output] * unit,
        known / np.outer(unit, unit),
        c[first - 1 :],
        float(noise[first, output]),
    )
    return Truth(world, ParameterDrift(drift.keep[first:], drift.variance[first:]))


def of_imm(setup: Setup, estimator: Imm) -> Motions:
    """Modes of `imm`."""
    scale, nx = np.tile(Coordinates.of(setup.model, setup.parameters).scale, 2), estimator.layout.nx
    noise = np.array([np.diag(mode.noise)[nx:] for mode in estimator.modes])
    entry = np.array([np.diag(mode.entry)[nx:] for mode in estimator.modes])
    return Motions(noise / scale**2, entry / scale**2, estimator.transitions)


def of_adaptive_imm(setup: Setup, estimator: AdaptiveImm) -> Motions:
    """Modes of `adaptive_imm` with a right model."""
    scale = np.tile(Coordinates.of(setup.model, setup.parameters).scale, 2)
    modes, nx = estimator.modes, estimator.layout.nx
    right = [i for i, kind in enumerate(modes.kinds) if kind != "reference" and not modes.discrepancy[i]]
    matrix, where = estimator.transitions[np.ix_(right, right)], slice(nx, estimator.layout.size)
    matrix = matrix / matrix.sum(axis=1, keepdims=True)
    return Motions(modes.noise[right, where] / scale**2, modes.entry[right, where] / scale**2, matrix)


def told_how(setup: Setup, key: str) -> Motions:
    """Rest and drifts of the true kind, rate and mean duration."""
    seconds = RAMP_S.get(key, 1200.0)
    rate = RAMP_PER_HOUR * 600.0 / seconds
    q = len(setup.parameters)
    drifting = np.ones((1, q)) if key in TOGETHER else np.eye(q)
    entry = np.hstack([np.zeros_like(drifting), (rate / 3600.0) ** 2 * drifting])
    entry = np.vstack([np.zeros(2 * q), entry])
    imm = Imm(setup, rest_s=seconds, drift_s=seconds, jump_share=0.0)
    matrix = imm.transitions[: 1 + q, : 1 + q]
    if key in TOGETHER:
        matrix = transitions(imm.modes[:2], {"rest": seconds, "drift": seconds, "jump": 1.0}, 0.0, setup.dt)
    return Motions(np.zeros_like(entry), entry, matrix / matrix.sum(axis=1, keepdims=True))


def errors(key: str, scenario: Scenario, seeds: Sequence[int]) -> dict[str, FloatArray]:
    """Root mean square errors (q,) of each filter over seeds and draws."""
    walks, setup = key == "walk", scenario.setup
    q = len(setup.parameters)
    filters = {"imm": of_imm(setup, Imm(setup)), "adaptive_imm": of_adaptive_imm(setup, AdaptiveImm(setup))}
    if not walks:
        filters["told how"] = told_how(setup, key)
    one = Motions(np.zeros((1, 2 * q)), np.zeros((1, 2 * q)), np.eye(1))
    squares: dict[str, list[FloatArray]] = {}
    for seed in track_progress(seeds, key, console=Console(stderr=True)):
        run = truth(scenario, seed, walks=walks)
        found = {"told when": track(run.world, one, DRAWS, seed, run.drift)}
        found |= {name: track(run.world, motions, DRAWS, seed) for name, motions in filters.items()}
        for name, error in found.items():
            squares.setdefault(name, []).append((error**2).mean(axis=(0, 1)))
    return {name: np.sqrt(np.mean(values, axis=0)) for name, values in squares.items()}


def main() -> None:
    """Print a row for each truth."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--truth", action="append", choices=ROWS, help="repeatable; default all")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    names = ("told how", "imm", "adaptive_imm")
    table = Table("truth", "told when: n / C, %", *names)
    with TemporaryDirectory() as folder:
        for key in options.truth or ROWS:
            found = errors(key, TRUTHS[key].scenario(Path(folder), key), seeds)
            least = found["told when"]
            ratios = ["–" if n not in found else " / ".join(f"{r:.2f}" for r in found[n] / least) for n in names]
            table.add_row(TRUTHS[key].words, " / ".join(f"{100 * e:.2f}" for e in least), *ratios)
    Console(width=None if Console().is_terminal else 160).print(table)


if __name__ == "__main__":
    main()
