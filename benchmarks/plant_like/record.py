"""Record k of a seed: its table, sampled every 10 s, and its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.hidden_effects.cell.simulate import SimulationError
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS
from benchmarks.hidden_effects.generate.categories import DrawError
from benchmarks.hidden_effects.generate.ground_truth import Hidden
from benchmarks.hidden_effects.plant.experiment import SimulatedRun, run
from benchmarks.plant_like.background import EVERY, Background, draw_background
from benchmarks.plant_like.draw import draw_experiment, draw_sized, entry_of

ATTEMPTS = 12


@dataclass(frozen=True)
class Record:
    """A record (an empty cell is a missing value) and its answer, as `benchmarks.hidden_effects.score` reads it."""

    table: pd.DataFrame
    answer: dict[str, Any]


def make_record(seed: int, k: int) -> Record:
    """Record k of a seed, always the same whatever the number of records.

    Raises
    ------
    RuntimeError
        No attempt gave a cell that runs.
    """
    entry, problems = entry_of(seed, k), []
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k, attempt)))
        background = draw_background(rng)
        experiment = draw_experiment(rng, background)
        try:
            calm = run(experiment, background.specs)
            effect = draw_sized(rng, experiment, background, entry, calm) if entry else None
        except (SimulationError, DrawError) as error:
            problems.append(str(error))
            continue
        hidden = [Hidden.of(effect.spec, effect.size)] if effect else []
        done = effect.done if effect else calm
        answer = {
            "record": f"record_{k:04d}",
            "category": "single" if hidden else "none",
            "right_verdicts": [] if hidden else ["none", "abstain", "insufficient"],
            "effects": [vars(h) for h in hidden],
            "tolerated": _tolerated(background),
            "size": effect.size if effect else {},
            "loop": experiment.loop,
            "noise": background.noise.details,
            "background": {s.site: s.amplitude for s in background.specs},
        }
        return Record(_table(done, background), answer)
    raise RuntimeError(f"record {k} of seed {seed}: {'; '.join(problems)}")


def _tolerated(background: Background) -> list[dict[str, str]]:
    """True names of what is wrong on every record."""
    names = [{"site": s.site, "driver": "constant", "why": "this constant is off"} for s in background.constants]
    return [*names, {"site": "feed_grade", "driver": "time", "why": "the feed grade wanders"}]


def _table(done: SimulatedRun, background: Background) -> pd.DataFrame:
    """The last second of every interval, with the inputs that were held over it."""
    rows = slice(EVERY - 1, None, EVERY)
    measured = {name: done.noisy[name][rows].copy() for name in OUTPUTS}
    for outputs, first, length in background.gaps:
        for name in outputs:
            measured[name][first : first + length] = np.nan
    inputs = dict(zip(INPUTS, done.inputs[rows].T, strict=True))
    time = EVERY * (1.0 + np.arange(len(measured[OUTPUTS[0]])))
    return pd.DataFrame({"time_s": time} | inputs | measured)
