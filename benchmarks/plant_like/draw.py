"""Moves of an operator over a shift, and the effect of a plant-like record."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.simulate import Array, SimulationError
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE, Entry
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.generate.categories import DrawError
from benchmarks.hidden_effects.generate.draw import draw_effect, limits_of
from benchmarks.hidden_effects.generate.nominal_fit import project, sensitivity
from benchmarks.hidden_effects.generate.sizing import ANY_OUTPUT
from benchmarks.hidden_effects.plant.excitation import hold
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, nominal, run
from benchmarks.plant_like.background import BURN, EVERY, ROWS, Background

Rng = np.random.Generator
Columns = dict[str, Array]
TARGETS = (2.0, 8.0)
"""Size of an effect: what it changes, over all else that the fitted model leaves, both root mean squares."""
TRIALS = 4
SETTLED = slice(300, None)


@dataclass(frozen=True)
class Effect:
    """An effect, the run with it, and its size in each output."""

    spec: Spec
    done: SimulatedRun
    size: dict[str, float]


def draw_experiment(rng: Rng, background: Background) -> Experiment:
    """A shift: open loop, or the air under a PI controller of the grade in a third of the records."""
    count = BURN + ROWS
    feed = hold(rng, count, 0.92 * c.FEED_FLOW, 1.08 * c.FEED_FLOW, (1200.0, 3600.0))
    level = hold(rng, count, 0.345, 0.405, (900.0, 2700.0))
    loop = "pi" if rng.random() < 1 / 3 else "open"
    if loop == "open":
        first = hold(rng, count, c.AIR_LIMITS[0] * 1.05, c.AIR_LIMITS[1] * 0.95, (600.0, 1800.0))
    else:
        first = hold(rng, count, 0.16, 0.26, (1800.0, 4500.0))
    moves = np.column_stack([first, feed, level])
    moves = np.repeat(moves[::EVERY], EVERY, axis=0)[:count]  # the record shows every move where it happens
    n, C = float(rng.uniform(0.95, 1.06)) * c.GROWTH_EXPONENT, float(rng.uniform(0.85, 1.2)) * c.COALESCENCE_RATE
    seed = int(rng.integers(2**31))
    return Experiment(ROWS, BURN, n, C, loop, moves, seed, background.noise, OUTPUTS)


def entry_of(seed: int, k: int) -> Entry | None:
    """The effect of record k, every entry of the catalogue in turn; None for each third record."""
    if k % 3 == 2:
        return None
    order = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2**31,))).permutation(len(CATALOGUE))
    return CATALOGUE[int(order[(k - k // 3) % len(CATALOGUE)])]


def draw_sized(rng: Rng, experiment: Experiment, background: Background, entry: Entry, calm: SimulatedRun) -> Effect:
    """Draw an effect, and search the amplitude that gives it its size.

    Raises
    ------
    DrawError
        No amplitude within its limits is large enough.
    SimulationError
        The cell does not run.
    """
    spec = draw_effect(rng, entry, calm)
    target = float(np.exp(rng.uniform(*np.log(TARGETS))))
    ruler = Ruler.of(experiment, calm)
    amplitude, limits = spec.amplitude, limits_of(entry, spec.shape)
    roof = limits[1] if amplitude > 0 else limits[0]
    best: Effect | None = None
    for _ in range(TRIALS):
        trial = replace(spec, amplitude=amplitude)
        try:
            done = run(experiment, (trial, *background.specs))
        except SimulationError:
            roof = 0.7 * abs(amplitude)
            amplitude *= 0.5
            continue
        size = ruler.size(done)
        now = _counts(entry.site, size)
        if best is None or abs(np.log(now / target)) < abs(np.log(_counts(entry.site, best.size) / target)):
            best = Effect(trial, done, size)
        wish = min(abs(amplitude) * float(np.clip(target / max(now, 1e-9), 0.1, 4.0)), roof)
        if abs(np.log(now / target)) < 0.26 or abs(wish - abs(amplitude)) < 0.05 * abs(amplitude):
            break
        amplitude = float(np.copysign(wish, amplitude))
    if best is None or _counts(entry.site, best.size) < 0.7 * TARGETS[0]:
        raise DrawError(f"{entry.site}/{entry.driver}: too small")
    return best


@dataclass(frozen=True)
class Ruler:
    """What sizes are measured by: a run without the effect, the nominal cell under its inputs, and what that leaves.

    `left` is the root mean square, noise included, of what the nominal cell with fitted n and C leaves.
    """

    experiment: Experiment
    calm: SimulatedRun
    wrong: Columns
    slopes: list[Columns]
    noise: dict[str, float]
    left: dict[str, float]

    @staticmethod
    def of(experiment: Experiment, calm: SimulatedRun) -> Ruler:
        """Measure a run without an effect."""
        base = nominal(experiment, calm)
        theta = np.log(np.array([experiment.n, experiment.C]))
        slopes = sensitivity(theta, calm.inputs, calm.start, base, OUTPUTS)
        noise = {name: float(np.std(calm.noisy[name] - calm.clean[name])) for name in OUTPUTS}
        wrong = {name: calm.clean[name] - base[name] for name in OUTPUTS}
        hidden = project(wrong, slopes, noise, SETTLED)
        left = {name: float(np.hypot(_rms(hidden[name]), noise[name])) for name in OUTPUTS}
        return Ruler(experiment, calm, wrong, slopes, noise, left)

    def size(self, done: SimulatedRun) -> dict[str, float]:
        """What the effect changes and n and C do not hide; in closed loop the controller hides some of it as well."""
        if self.experiment.loop == "open":
            difference = {name: done.clean[name] - self.calm.clean[name] for name in OUTPUTS}
        else:
            base = nominal(self.experiment, done)
            difference = {name: done.clean[name] - base[name] - self.wrong[name] for name in OUTPUTS}
        hidden = project(difference, self.slopes, self.noise, SETTLED)
        return {name: _rms(hidden[name]) / self.left[name] for name in OUTPUTS}


def _counts(site: str, size: dict[str, float]) -> float:
    return max(size.values()) if site in ANY_OUTPUT else size["concentrate_grade"]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values[SETTLED] ** 2)))
