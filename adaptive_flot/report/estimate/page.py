"""The report of `estimate`: a measured record replayed through estimators."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from adaptive_flot.charts.plotdata import Chart
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.files import write_text
from adaptive_flot.greybox.model import Quantity
from adaptive_flot.provenance import values_hash
from adaptive_flot.report.estimate import answer, series
from adaptive_flot.report.estimate.innovations import innovations_section
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Bullets, Part, Picture, Section, Table, Text, present
from adaptive_flot.report.kit.plotdata import Residuals
from adaptive_flot.report.kit.residuals import residual_pictures
from adaptive_flot.report.kit.wording import number, p_text, spaced
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.commands.replay import Replay
from adaptive_flot.runner.results.whiteness import WHITENESS_LAGS


def write_estimate_report(
    result: RecordEstimate, path: Path | str, command: str = "", read: Sequence[Path] = ()
) -> None:
    """Write the report as a single HTML file without external parts.

    Parameters
    ----------
    result
        What `estimate_record` returned.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the foot.
    read
        Files whose hashes the foot shows.
    """
    write_text(Path(path), estimate_report(result, command, read))


def estimate_report(result: RecordEstimate, command: str = "", read: Sequence[Path] = ()) -> str:
    """Return the page that `write_estimate_report` writes."""
    album = Album()
    outputs = series.measured_outputs(result)
    first = present(answer.fit_matrix(result), _free_run_picture(result, album))
    record = [_output_picture(result, q, album) for q in outputs]
    record.append(_input_picture(result, album))
    fitted: list[Part] = [
        _fit_table(result),
        Text(f"Identifiability: {result.batch.identifiability.verdict}."),
        _parameter_picture(result, album),
    ]
    page = Page(
        kind="Estimation report",
        title=answer.title(result),
        lead=_lead(result),
        answer=answer.sentences(result),
        facts=answer.facts(result),
        first=first,
        sections=[
            Section(
                "errors",
                "Errors",
                "one step ahead and free run",
                [Bullets(answer.per_output(result)), _error_table(result)],
            ),
            Section("fit", "Parameters", "batch fit, and over time", fitted),
            *innovations_section(result, album),
            Section("record", "One step ahead", "predictions, their errors, inputs", record),
            Section(
                "residuals",
                "Residuals",
                "whiteness, statuses",
                [*(p for q in outputs for p in _residual_pictures(result, q, album)), _status_table(result)],
            ),
        ],
        made=made_by(command, _made(result), read),
    )
    return render(page, album)


def _made(result: RecordEstimate) -> list[tuple[str, str]]:
    blocks = (result.blocks.fit, result.blocks.test)
    data = values_hash(array for b in blocks for array in (b.time, b.inputs, b.outputs))
    return [("Model", result.setup.model.name), ("Record", result.blocks.name), ("SHA-256 of the values read", data)]


def _lead(result: RecordEstimate) -> str:
    blocks = result.blocks
    how = "goes on where the fit block ends" if blocks.continues else "starts from the same initial state"
    driving = ", ".join(name.replace("_", " ") for name in result.setup.outputs)
    return (
        f"Record {blocks.name}: {len(blocks.fit)} rows to fit on, {blocks.tested} to test on, one every "
        f"{blocks.fit.dt:g} s; the test block {how}. Parameters and initial state come from the fit block only. "
        f"Driving outputs: {driving}."
    )


def _error_table(result: RecordEstimate) -> Table:
    powers = answer.powers(result)
    rows = []
    for replay in result.replays:
        for e in replay.errors:
            power = powers[e.output]
            one, free = (number(v * 10.0**-power, ".4g") for v in (e.one_step, e.free_run))
            name, unit = spaced(e.output), unit_text(e.unit, power)
            rows.append((replay.estimator, e.block, name, unit, one, free, p_text(e.ljung_box_p)))
    caption = (
        "Root mean square errors. One step: prediction of a sample before it is used. Free run: simulation with the "
        "parameters that the estimator had at the end of the fit block, never corrected by a measurement. An estimator "
        "that corrects neither state nor parameters has the same error in both. p: Ljung–Box test of the innovations, "
        f"{WHITENESS_LAGS} lags."
    )
    header = ("Estimator", "Block", "Output", "Unit", "One step", "Free run", "p")
    colours = tuple(answer.colour_name(result, row[0]) for row in rows)
    return Table(caption, header, tuple(rows), words=4, colours=colours)


def _fit_table(result: RecordEstimate) -> Table:
    model = result.setup.model
    rows = []
    for e, (_, relative, judged) in zip(result.batch.estimates, result.batch.identifiability.parameters, strict=True):
        nominal = model.parameters[model.index("parameters", e.name)].value
        power = exponent(np.array([e.value, nominal]))
        values = (number(v * 10.0**-power, ".4f") for v in (nominal, e.value, e.std))
        rows.append((e.label, e.name, unit_text(e.unit, power), judged, *values, number(100 * relative, ".1f")))
    caption = "Batch fit (prediction error method) of the fit block."
    header = ("Symbol", "Parameter", "Unit", "Verdict", "Nominal", "Estimate", "σ", "σ [% of its scale]")
    return Table(caption, header, tuple(rows), words=4)


def _free_run_picture(result: RecordEstimate, album: Album) -> Picture:
    """The first chart: what was measured, and what the model says without ever seeing it."""
    caption = (
        f"{result.blocks.name}: measured values, and free runs of the model with the parameters each estimator had at "
        "the end of the fit block, never corrected by a measurement."
        + (" Dotted: where the test block begins." if result.blocks.continues else " Test block.")
    )
    chart = Chart(tuple(series.free_run_panels(result)), marks=series.block_marks(result))
    return album.chart(chart, caption, "Measured outputs over time, and free runs of the model")


def _output_picture(result: RecordEstimate, q: Quantity, album: Album) -> Picture:
    name = spaced(q.name)
    caption = f"{result.blocks.name}: {name}, measured and predicted one step ahead; below, the error."
    chart = Chart(tuple(series.output_panels(result, q)), marks=series.block_marks(result))
    return album.chart(chart, caption, f"Measured and predicted {name}")


def _input_picture(result: RecordEstimate, album: Album) -> Picture:
    chart = Chart(tuple(series.input_panels(result)), marks=series.block_marks(result))
    return album.chart(chart, f"{result.blocks.name}: inputs.", "Inputs over time")


def _parameter_picture(result: RecordEstimate, album: Album) -> Picture:
    caption = f"{result.blocks.name}: parameters with the ±2σ each estimator claims."
    chart = Chart(tuple(series.parameter_panels(result)), marks=series.block_marks(result))
    return album.chart(chart, caption, "Parameters over time")


def _residual_pictures(result: RecordEstimate, q: Quantity, album: Album) -> list[Picture]:
    rows = []
    for replay in result.replays:
        role, index = series.roles(result)[replay.estimator]
        own = replay.table[replay.table["block"] == "test"]
        innovation = own[f"{q.column}_innovation"].to_numpy()
        std = _noise(result, q, replay)
        p = next(e.ljung_box_p for e in replay.errors if e.block == "test" and e.output == q.name)
        rows.append(Residuals(replay.estimator, role, index, own["time_s"].to_numpy(), innovation / std, p))
    name = spaced(q.name)
    caption = (
        f"{result.blocks.name}, test block: innovations of {name} over the noise level of the batch fit (of this block "
        "where the output did not drive the fit)."
    )
    return residual_pictures(rows, caption, f"Innovations of {name}", album)


def _noise(result: RecordEstimate, q: Quantity, replay: Replay) -> float:
    if q.name in result.setup.outputs:
        return float(result.batch.noise_std[result.setup.outputs.index(q.name)])
    return next(e.one_step for e in replay.errors if e.block == "test" and e.output == q.name)


def _status_table(result: RecordEstimate) -> Table:
    known = sorted({name for r in result.replays for name in r.status_counts})
    rows: Sequence[tuple[str, ...]] = [
        (r.estimator, *(str(r.status_counts.get(name, 0)) for name in known)) for r in result.replays
    ]
    return Table("Samples by status.", ("Estimator", *known), tuple(rows))
