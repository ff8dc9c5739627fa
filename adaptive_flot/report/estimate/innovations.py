"""The part of the estimation report on the innovations form: errors by horizon, smoothed states and parameters."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.charts.units import amount, exponent, unit_text, with_std
from adaptive_flot.contracts.batch import ParameterEstimate
from adaptive_flot.report.estimate import series
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Bullets, Part, Section, Table
from adaptive_flot.report.kit.wording import joined, number, spaced
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.commands.innovations.estimate import InnovationsEstimate

FAR = 3.0
"""Standard deviations of the batch fit from which a value with process noise is outside its interval."""
SHOWN_STATES = 12
"""States that the picture shows at most; the file has all."""


def innovations_sentences(result: RecordEstimate) -> list[str]:
    """What process noise makes of the record, in words; nothing without the innovations form."""
    form = result.innovations
    if form is None:
        return []
    said = []
    for output in dict.fromkeys(e.output for e in form.errors):
        own = [e for e in form.errors if e.output == output]
        ahead = joined([f"{amount(e.error, e.unit)} up to {e.rows} row{'s' if e.rows > 1 else ''} ahead" for e in own])
        said.append(f"With process noise, {spaced(output)} is predicted on the test block to {ahead}.")
    parameters = joined([f"{e.label} = {with_std(e.value, e.std, e.unit)}" for e in form.estimates])
    said.append(f"With process noise: {parameters}.")
    said += _which_to_believe(result, form)
    said.append(
        "The parameters wander over the record: see their smoothed course."
        if form.noise.walk
        else "Nothing speaks for parameters that wander."
    )
    return said


def _which_to_believe(result: RecordEstimate, form: InnovationsEstimate) -> list[str]:
    """A sentence where intervals of the batch fit exclude what process noise finds; nothing else."""
    batch = {e.label: e for e in result.batch.estimates}
    apart = [e.label for e in form.estimates if _excludes(batch.get(e.label), e.value)]
    if not apart:
        return []
    return [
        f"The interval of the batch fit excludes that of {joined(apart)}. It holds only for errors without a memory: "
        "where the Ljung-Box p is small, believe the values with process noise."
    ]


def _excludes(estimate: ParameterEstimate | None, value: float) -> bool:
    return estimate is not None and abs(estimate.value - value) > FAR * estimate.std


def innovations_section(result: RecordEstimate, album: Album) -> list[Section]:
    """Section of the page; none without the innovations form."""
    form = result.innovations
    if form is None:
        return []
    parts: list[Part] = [Bullets(innovations_sentences(result)), _error_table(result, form)]
    marks = series.block_marks(result)
    chart = Chart(tuple(_output_panels(result, form)), marks=marks)
    caption = f"{result.blocks.name}: measured, and predicted one row ahead with ±2σ."
    parts.append(album.chart(chart, caption, "Measured outputs and predictions one row ahead"))
    chart = Chart(tuple(_smoothed_panels(result, form)), marks=marks)
    caption = f"{result.blocks.name}: parameters and states given all rows of the record, with ±2σ (smoothed)."
    parts.append(album.chart(chart, caption, "Smoothed parameters and states"))
    return [Section("innovations", "With process noise", "errors by horizon, smoothed states", parts)]


def _error_table(result: RecordEstimate, form: InnovationsEstimate) -> Table:
    horizons = sorted({e.rows for e in form.errors})
    free = {
        e.output: e.free_run for r in result.replays for e in r.errors if e.block == "test" and r.estimator == "pem"
    }
    rows = []
    for output in dict.fromkeys(e.output for e in form.errors):
        own = {e.rows: e for e in form.errors if e.output == output}
        values = [own[h].error for h in horizons] + ([free[output]] if free else [])
        power = exponent(np.array(values))
        unit = unit_text(own[horizons[0]].unit, power)
        rows.append((spaced(output), unit, *(number(v * 10.0**-power, ".4g") for v in values)))
    header = [
        "Output",
        "Unit",
        *(f"≤ {h} row{'s' if h > 1 else ''}" for h in horizons),
        *(["Free run"] if free else []),
    ]
    caption = (
        "Root mean square errors on the test block by horizon: rows since the last measurement that was used. "
        "Free run: the batch fit, never corrected."
    )
    return Table(caption, tuple(header), tuple(rows), words=2)


def _shown(result: RecordEstimate, form: InnovationsEstimate) -> pd.DataFrame:
    """Both blocks where they follow each other in time, else the test block."""
    return form.table if result.blocks.continues else form.table[form.table["block"] == "test"]


def _output_panels(result: RecordEstimate, form: InnovationsEstimate) -> list[Panel]:
    table, model, (fit, test) = _shown(result, form), result.setup.model, (result.blocks.fit, result.blocks.test)
    panels = []
    for name in dict.fromkeys(e.output for e in form.errors):
        c = model.index("outputs", name)
        q = model.outputs[c]
        both = np.concatenate([fit.outputs[:, c], test.outputs[1:, c]])
        measured = both if result.blocks.continues else test.outputs[:, c]
        traces = (
            Trace("measured", table["time_s"].to_numpy(), measured, Role.TRUTH),
            _trace("one row ahead", table, f"{q.column}_predicted"),
        )
        panels.append(Panel(spaced(name), q.unit, traces))
    return panels


def _smoothed_panels(result: RecordEstimate, form: InnovationsEstimate) -> list[Panel]:
    """Parameters where they walk, then states."""
    table = _shown(result, form)
    walking = form.estimates if form.noise.walk else ()
    parameters = [Panel(e.label, e.unit, (_trace("smoothed", table, f"{e.label}_smoothed"),)) for e in walking]
    states = result.setup.model.states[:SHOWN_STATES]
    return [*parameters, *(Panel(spaced(s.name), s.unit, (_trace("smoothed", table, s.column),)) for s in states)]


def _trace(label: str, table: pd.DataFrame, column: str) -> Trace:
    std = table[f"{column}_std"].to_numpy()
    return Trace(label, table["time_s"].to_numpy(), table[column].to_numpy(), Role.ESTIMATE, std=std)
