"""Record k of a seed: its table, that of its reference where it has one, and its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.other_processes.mess import measured
from benchmarks.other_processes.plants import PROCESSES
from benchmarks.other_processes.process import NOTHING, Case, Process
from benchmarks.other_processes.world import Columns, Rng, World

QUIET = 0.25
"""Share of the records in which nothing is the matter."""
FEEDBACK = 1 / 3
ATTEMPTS = 20
VISIBLE = 4.0
"""Least root mean square change of an output by what is the matter, over the standard deviation of its noise."""
REFERENCE_ROWS = 0.8
"""Rows of a reference, as a share of those of the record."""
NO_NAME = ("none", "abstain", "insufficient")


@dataclass(frozen=True)
class Record:
    """A record, its reference or None, what its user says of it, and its answer."""

    table: pd.DataFrame
    reference: pd.DataFrame | None
    told: dict[str, Any]
    answer: dict[str, Any]


def make_record(seed: int, k: int, processes: Sequence[Process] = PROCESSES) -> Record:
    """Record k of a seed, always the same whatever the number of records; processes take their turn.

    Raises
    ------
    RuntimeError
        No attempt gave an effect that shows.
    """
    count = len(processes)
    process, referred = processes[k % count], has_reference(k, count)
    name = case_of(process, seed, k, count)
    for attempt in range(ATTEMPTS):
        streams = np.random.SeedSequence(seed, spawn_key=(k, attempt)).spawn(5)
        rng = np.random.default_rng(streams[4])
        rows, feedback = (
            int(rng.integers(process.rows[0], process.rows[1] + 1)),
            bool(rng.random() < FEEDBACK) and process.controlled,
        )
        clean = simulate(process, streams, rows, name, feedback)
        size = _size(process, clean, simulate(process, streams, rows, NOTHING, feedback))
        if name != NOTHING and max(size.values()) < VISIBLE:
            continue
        table = _table(process, measured(rng, clean, process.noise))
        old = None
        if referred:
            before = simulate(process, streams, int(REFERENCE_ROWS * rows), NOTHING, feedback, again=True)
            old = _table(process, measured(rng, before, process.noise))
        case = process.cases[name]
        told = {"model": f"{process.make_model.__module__}:{case.model}", "reference": referred}
        return Record(table, old, told, _answer(process, name, case, k, size, referred, feedback))
    raise RuntimeError(f"record {k} of seed {seed}: {process.name}, {name}: no attempt shows")


def has_reference(k: int, count: int = len(PROCESSES)) -> bool:
    """Whether record k of so many processes has a reference: a third of those of each process."""
    return (k // count + k % count) % 3 == 2


def case_of(process: Process, seed: int, k: int, count: int = len(PROCESSES)) -> str:
    """What is the matter in record k: nothing in some, else every case of the process in turn."""
    referred, place = has_reference(k, count), k % count
    allowed = ("both", "reference") if referred else ("both", "alone")
    names = [n for n, c in process.cases.items() if n != NOTHING and c.when in allowed]
    if np.random.default_rng((seed, k)).random() < QUIET:
        return NOTHING
    earlier = sum(has_reference(j, count) == referred for j in range(place, k, count))
    order = np.random.default_rng((seed, place, referred)).permutation(len(names))
    return names[int(order[earlier % len(names)])]


def simulate(
    process: Process,
    streams: Sequence[np.random.SeedSequence],
    rows: int,
    case: str,
    feedback: bool,
    *,
    again: bool = False,
    rich: float = 1.0,
) -> Columns:
    """Columns of one record without what sensors do to it; with `again` another record of the same plant."""
    draws: list[Rng] = [np.random.default_rng(s) for s in (streams[0], streams[3 if again else 1], streams[2])]
    return process.plant(World(rows, process.dt, case, rich, feedback, *draws))


def _size(process: Process, clean: Columns, calm: Columns) -> dict[str, float]:
    """Change of each column that is measured or moved by a controller, over noise or a hundredth of its range."""
    scale = {name: process.noise.get(name, 0.05 * float(np.ptp(calm[name]))) for name in calm if name in clean}
    return {n: float(np.sqrt(np.mean((clean[n] - calm[n]) ** 2)) / s) for n, s in scale.items() if s > 0}


def _table(process: Process, columns: Columns) -> pd.DataFrame:
    count = len(next(iter(columns.values())))
    return pd.DataFrame({"time_s": process.dt * (1.0 + np.arange(count))} | columns)


def _answer(
    process: Process, name: str, case: Case, k: int, size: dict[str, float], referred: bool, feedback: bool
) -> dict[str, Any]:
    effects = []
    if case.names:
        (site, driver), *others = case.names
        effects = [{"site": site, "driver": driver, "accepted": [{"site": s, "driver": d} for s, d in others]}]
    # what the plant has all the time, has not changed since its reference
    lasting = {} if referred else {p: why for p, why in process.tolerated.items() if p not in case.names}
    known = lasting | dict.fromkeys(case.tolerated, name)
    tolerated = [{"site": s, "driver": d, "why": why} for (s, d), why in known.items()]
    return {
        "record": f"record_{k:04d}",
        "process": process.name,
        "case": name,
        "category": "single" if effects else "none",
        "right_verdicts": [] if effects else list(NO_NAME),
        "effects": effects,
        "tolerated": tolerated,
        "size": size if name != NOTHING else {},
        "reference": referred,
        "feedback": feedback,
    }
