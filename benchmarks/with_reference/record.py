"""Record k of a seed, its reference, and its answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.hidden_effects.cell.simulate import SimulationError
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE, Entry
from benchmarks.hidden_effects.generate.categories import DrawError, sized_effect
from benchmarks.hidden_effects.generate.draw import draw_experiment
from benchmarks.hidden_effects.generate.ground_truth import Hidden
from benchmarks.hidden_effects.plant.experiment import SimulatedRun, run

ATTEMPTS = 10
NONE_EVERY = 4
"""One record of so many has no effect."""


@dataclass(frozen=True)
class Record:
    """A new record, its reference, and the answer as `benchmarks.hidden_effects.score` reads it."""

    new: pd.DataFrame
    reference: pd.DataFrame
    answer: dict[str, Any]


def entry_of(seed: int, k: int) -> Entry | None:
    """The effect of record k, every entry of the catalogue in turn; None for each fourth record."""
    if k % NONE_EVERY == NONE_EVERY - 1:
        return None
    order = np.random.default_rng(seed).permutation(len(CATALOGUE))
    return CATALOGUE[int(order[(k - k // NONE_EVERY) % len(order)])]


def make_record(seed: int, k: int) -> Record:
    """Record k of a seed, always the same whatever the number of records.

    Raises
    ------
    RuntimeError
        No attempt gave a cell that runs, and an effect that is large enough.
    """
    entry, problems = entry_of(seed, k), []
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, k, attempt])
        try:
            experiment = draw_experiment(rng, thin_allowed=False)
            usual = replace(draw_experiment(rng, thin_allowed=False, loop="open"), n=experiment.n, C=experiment.C)
            reference = run(usual)
            if entry is None:
                done, hidden, size = run(experiment), [], dict[str, float]()
            else:
                spec, sized = sized_effect(experiment, entry, rng, last=False)
                done, size = sized.done, sized.removable
                hidden = [_with_other_names(Hidden.of(spec, size))]
        except (SimulationError, DrawError) as error:
            problems.append(str(error))
            continue
        answer = {
            "record": f"record_{k:04d}",
            "category": "single" if hidden else "none",
            "right_verdicts": [] if hidden else ["none"],
            "effects": [vars(h) for h in hidden],
            "tolerated": [],
            "size": size,
            "loop": experiment.loop,
            "noise": experiment.noise.kind,
        }
        return Record(_table(done), _table(reference), answer)
    raise RuntimeError(f"record {k} of seed {seed}: {'; '.join(problems)}")


def _with_other_names(hidden: Hidden) -> Hidden:
    """A sensor that errs by a share of its value, or along a bent line, depends on its own value."""
    if not hidden.site.endswith("_sensor") or hidden.shape not in ("gain", "bent"):
        return hidden
    other = {"site": hidden.site, "driver": "own_value", "reason": f"{hidden.shape} is an error of the span"}
    return replace(hidden, accepted=[*hidden.accepted, other])


def _table(done: SimulatedRun) -> pd.DataFrame:
    inputs = dict(zip(INPUTS, done.inputs.T, strict=True))
    time = {"time_s": np.arange(1.0, len(done.inputs) + 1.0)}
    return pd.DataFrame(time | inputs | {name: done.noisy[name] for name in OUTPUTS})
