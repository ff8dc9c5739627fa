"""What was stored, as a record that `discover`, `estimate` and `run` read."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import pandas as pd
from sqlalchemy import Engine, select

from adaptive_flot.contracts import DelayedValue, Sample
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.errors import LinkError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.numbers import as_array


@dataclass(frozen=True)
class Stretch:
    """Samples without a long gap between them, by the plant's clock [s]."""

    start: float
    samples: tuple[Sample, ...]

    @property
    def end(self) -> float:
        """Plant's time of the last sample [s]."""
        return self.start + self.samples[-1].time - self.samples[0].time


def stretches(engine: Engine, link: Link) -> list[Stretch]:
    """All samples of a link's scenario, cut where the samples have a gap longer than its file allows, oldest first.

    Times are put on the grid of the sampling interval. Intervals without sample have the inputs of the sample before,
    and no output.
    """
    s, c = schema.samples.c, schema.cycles.c
    query = (
        select(c.plant_time, s.inputs, s.outputs, s.delayed, c.record_time)
        .join(schema.cycles, (s.session == c.session) & (s.cycle == c.cycle))
        .join(schema.sessions, schema.sessions.c.session == s.session)
        .where(schema.sessions.c.scenario == link.scenario.name)
        .order_by(c.session, c.cycle)
    )
    dt, longest = link.scenario.dt, link.file.cycle.longest_gap_s
    found: list[list[Sample]] = []
    with engine.connect() as connection:
        for plant_time, inputs, outputs, delayed, record_time in connection.execute(query):
            late = _delayed(delayed, plant_time - record_time)
            sample = Sample(plant_time, as_array(inputs), as_array(outputs), late)
            rows = round((plant_time - found[-1][-1].time) / dt) if found else 0
            if found and 1 <= rows <= longest / dt + 1:
                last = found[-1][-1]
                found[-1] += [_unseen(last, last.time + k * dt) for k in range(1, rows)]
                found[-1].append(replace(sample, time=last.time + rows * dt))
            elif not found or rows != 0:
                found.append([sample])
    return [Stretch(samples[0].time, tuple(samples)) for samples in found]


def _delayed(text: str, offset: float) -> tuple[DelayedValue, ...]:
    """Delayed values in a text, their times on the plant's clock."""
    parts = [entry.split(" ") for entry in text.split("; ") if entry]
    return tuple(DelayedValue(output, float(time) + offset, float(value)) for output, time, value in parts)


def _unseen(before: Sample, time: float) -> Sample:
    return Sample(time, before.inputs, np.full_like(before.outputs, math.nan))


def chosen_stretch(link: Link, known: list[Stretch], begin: float | None, end: float | None) -> Stretch:
    """The longest stretch that reaches into a time, by the plant's clock [s]; default the longest of all.

    Raises
    ------
    LinkError
        Nothing is stored there.
    """
    inside = [s for s in known if (begin is None or s.end >= begin) and (end is None or s.start <= end)]
    if not inside:
        stored = f"; samples are stored from {_date(known[0].start)} to {_date(known[-1].end)}" if known else ""
        raise LinkError(f"{link.path}: no sample is stored there{stored}")
    return max(inside, key=lambda s: len(s.samples))


def _date(time: float) -> str:
    return datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%dT%H:%M:%S")


def record_table(link: Link, stretch: Stretch, begin: float | None = None, end: float | None = None) -> pd.DataFrame:
    """A stretch as a table with the model's columns: `time_s` from 0, inputs, outputs, measured parameters left out.

    Parameters
    ----------
    link
        The link file and its scenario.
    stretch
        The samples.
    begin, end
        Part of it, by the plant's clock [s]; default all.

    Raises
    ------
    LinkError
        Fewer than two samples lie there.
    """
    model, setup = link.scenario.model, link.scenario.setup
    samples = [
        s
        for s in in_time(stretch.samples, setup)
        if (begin is None or s.time >= begin - 1e-6) and (end is None or s.time <= end + 1e-6)
    ]
    if len(samples) < 2:
        raise LinkError(f"{link.path}: fewer than two samples are stored there; give other times")
    columns: dict[str, FloatArray] = {TIME_COLUMN: link.scenario.dt * np.arange(len(samples), dtype=np.float64)}
    columns |= {q.column: np.array([s.inputs[j] for s in samples]) for j, q in enumerate(model.inputs)}
    for j, q in enumerate(model.outputs):
        values = np.array([s.outputs[j] for s in samples])
        if np.isfinite(values).any():
            columns[q.column] = values
    return pd.DataFrame(columns)
