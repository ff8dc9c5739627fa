"""Charts of one scenario and controller: inputs, parameters, outputs, residuals."""

from __future__ import annotations

from adaptive_flot.charts.plotdata import Chart
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture
from adaptive_flot.report.kit.residuals import residual_pictures
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.report.run import series
from adaptive_flot.report.run.series import CaseRuns


def first_seed(case: CaseRuns) -> str:
    """Say which seed a time series shows; with one seed there is nothing to tell apart."""
    return f"Seed {case.seeds[0]}, the first of {len(case.seeds)}." if len(case.seeds) > 1 else f"Seed {case.seeds[0]}."


def input_picture(case: CaseRuns, album: Album) -> Picture:
    """Inputs that move."""
    panels, still = series.input_panels(case)
    constant = f" Constant: {', '.join(still)}." if still else ""
    names = ", ".join(p.label for p in panels)
    caption = f"{case.scenario.name}: inputs. {first_seed(case)}{constant}"
    return album.chart(Chart(tuple(panels)), caption, f"Inputs over time: {names}")


def parameter_picture(case: CaseRuns, album: Album) -> Picture:
    """Adapted parameters, true and estimated."""
    names = ", ".join(case.labels)
    caption = f"{case.scenario.name}: adapted parameters {names}, with the ±2σ the estimator claims. {first_seed(case)}"
    chart = Chart(tuple(series.parameter_panels(case)))
    return album.chart(chart, caption, f"Truth and estimates over time of {names}")


def output_picture(case: CaseRuns, album: Album) -> Picture:
    """Driving outputs, true and predicted, and the errors."""
    names = ", ".join(spaced(q.name) for q in case.outputs)
    caption = (
        f"{case.scenario.name}: {names}, true and predicted before each sample is used; below, the error on its own "
        f"scale (constant parameters leave the panel where they are worse). {first_seed(case)}"
    )
    chart = Chart(tuple(series.output_panels(case)))
    return album.chart(chart, caption, f"True and predicted {names} over time, and the errors")


def residuals_of(case: CaseRuns, album: Album) -> list[Picture]:
    """Innovations of each driving output."""
    pictures = []
    for q in case.outputs:
        rows = [series.residuals(case, run, q) for run in case.first.values()]
        name = spaced(q.name)
        caption = (
            f"{case.scenario.name}: innovations of {name} over the standard deviation the estimator expects. "
            f"{first_seed(case)}"
        )
        pictures += residual_pictures(rows, caption, f"Innovations of {name}", album)
    return pictures
