"""The report of `estimate`: a measured record replayed through estimators."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from adaptive_flot.files import write_text
from adaptive_flot.greybox.model import Quantity
from adaptive_flot.report.estimate import series
from adaptive_flot.report.estimate.series import Block
from adaptive_flot.report.kit import figures
from adaptive_flot.report.kit.page import Album, Page, Picture, Table, made_by, number, render
from adaptive_flot.report.kit.plotdata import Residuals
from adaptive_flot.report.kit.style import exponent, unit_text
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.commands.replay import Replay
from adaptive_flot.runner.results.whiteness import WHITENESS_LAGS

BLOCKS: tuple[Block, ...] = ("fit", "test")


def write_estimate_report(result: RecordEstimate, path: Path | str, command: str = "") -> None:
    """Write the report as a single HTML file without external parts.

    Parameters
    ----------
    result
        What `estimate_record` returned.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the footer.
    """
    write_text(Path(path), estimate_report(result, command))


def estimate_report(result: RecordEstimate, command: str = "") -> str:
    """Return the page that `write_estimate_report` writes."""
    album = Album()
    name = result.blocks.name
    outputs = series.measured_outputs(result)
    parameters = _parameter_picture(result, album)  # first, as it comes first on the page and so in number
    records = [
        album.add(figures.time_figure(series.input_panels(result)), f"{name}: inputs, fit block.", "Inputs over time")
    ]
    for block in BLOCKS:
        records += [_output_picture(result, q, block, album) for q in outputs]
    residuals = [_residual_picture(result, q, album) for q in outputs]
    page = Page(
        title=f"Estimation report: {name}",
        lead=_lead(result),
        contents=[("errors", "Errors"), ("fit", "Batch fit"), ("record", "Record"), ("residuals", "Residuals")],
        made=made_by(command, [("Model", result.setup.model.name)]),
    )
    return render(
        "estimate.html",
        page,
        errors=_error_table(result),
        findings=_findings(result),
        fit=_fit_table(result),
        verdict=result.batch.identifiability.verdict,
        record=records,
        parameters=parameters,
        residuals=residuals,
        statuses=_status_table(result),
    )


def _lead(result: RecordEstimate) -> str:
    blocks = result.blocks
    how = "goes on where the fit block ends" if blocks.continues else "starts from the same initial state"
    driving = ", ".join(name.replace("_", " ") for name in result.setup.outputs)
    return (
        f"{len(blocks.fit)} rows to fit on, {len(blocks.test)} to test on, one every {blocks.fit.dt:g} s; the test "
        f"block {how}. Parameters and initial state come from the fit block only. Driving outputs: {driving}."
    )


def _error_table(result: RecordEstimate) -> Table:
    rows = []
    for replay in result.replays:
        for e in replay.errors:
            power = exponent(np.array([e.one_step, e.free_run]))
            one, free = (number(v * 10.0**-power, ".4g") for v in (e.one_step, e.free_run))
            name, unit = e.output.replace("_", " "), unit_text(e.unit, power)
            rows.append((replay.estimator, e.block, name, unit, one, free, figures.p_text(e.ljung_box_p)))
    caption = (
        "Root mean square errors. One step: prediction of a sample before it is used. Free run: simulation with the "
        "parameters that the estimator had at the end of the fit block, never corrected by a measurement. An estimator "
        "that corrects neither state nor parameters has the same error in both. p: Ljung–Box test of the innovations, "
        f"{WHITENESS_LAGS} lags."
    )
    header = ("Estimator", "Block", "Output", "Unit", "One step", "Free run", "p")
    return Table(caption, header, tuple(rows), words=4)


def _findings(result: RecordEstimate) -> list[str]:
    """Sentences from the numbers: who predicts the test block best, and whether something is left."""
    sentences = []
    for q in series.measured_outputs(result):
        tests = {r.estimator: e for r in result.replays for e in r.errors if e.block == "test" and e.output == q.name}
        name = q.name.replace("_", " ")
        best = min(tests, key=lambda who: tests[who].free_run)
        unit = "" if q.unit == "-" else f" {q.unit}"
        text = f"{name}: {best} has the smallest free-run error on the test block, {tests[best].free_run:.4g}{unit}"
        p = tests[best].ljung_box_p
        if np.isfinite(p):
            left = "something is left that the model does not explain" if p < 0.05 else "they pass for white"
            text += f"; Ljung–Box p of its innovations there {figures.p_text(p)}: {left}"
        sentences.append(text + ".")
    return sentences


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


def _output_picture(result: RecordEstimate, q: Quantity, block: Block, album: Album) -> Picture:
    name = q.name.replace("_", " ")
    caption = f"{result.blocks.name}, {block} block: {name}, measured and predicted one step ahead; below, the error."
    figure = figures.time_figure(series.output_panels(result, q, block))
    return album.add(figure, caption, f"Measured and predicted {name}")


def _parameter_picture(result: RecordEstimate, album: Album) -> Picture:
    caption = f"{result.blocks.name}: parameters with the ±2σ each estimator claims."
    return album.add(figures.time_figure(series.parameter_panels(result)), caption, "Parameters over time")


def _residual_picture(result: RecordEstimate, q: Quantity, album: Album) -> Picture:
    rows = []
    for replay in result.replays:
        role, index = series.roles(result)[replay.estimator]
        own = replay.table[replay.table["block"] == "test"]
        innovation = own[f"{q.column}_innovation"].to_numpy()
        std = _noise(result, q, replay)
        p = next(e.ljung_box_p for e in replay.errors if e.block == "test" and e.output == q.name)
        rows.append(Residuals(replay.estimator, role, index, own["time_s"].to_numpy(), innovation / std, p))
    name = q.name.replace("_", " ")
    caption = (
        f"{result.blocks.name}, test block: innovations of {name} over the noise level of the batch fit (of this block "
        "where the output did not drive the fit), their autocorrelation and histogram."
    )
    return album.add(figures.residual_figure(rows), caption, f"Innovations of {name}")


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
