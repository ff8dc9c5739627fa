"""Charts of residuals: over time, and their autocorrelation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel, Trace
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture
from adaptive_flot.report.kit.plotdata import Residuals
from adaptive_flot.report.kit.wording import p_text

ACF_LAGS = 40
"""Lags of the autocorrelation shown."""
WHITE_BAND = 1.96
"""Half width of the 95 % band of the autocorrelation of white noise, times the root of the number of samples."""


def residual_pictures(rows: Sequence[Residuals], caption: str, alt: str, album: Album) -> list[Picture]:
    """Residuals over time with the +-2 band, and their autocorrelation with the 95 % band of white noise.

    Parameters
    ----------
    rows
        One estimator each. Missing samples (NaN) are left out of the autocorrelation.
    caption, alt
        Of the first picture; those of the second say what it adds.
    album
        Takes the pictures.
    """
    panels = tuple(
        Panel(
            f"{r.label}, Ljung–Box p {p_text(r.p_value)}",
            "-",
            (Trace("", r.time, r.values, r.role, r.index),),
            height=0.6,
            band=2.0,
            band_label="±2 standard deviations",
        )
        for r in rows
    )
    pictures = [album.chart(Chart(panels), caption, alt)]
    correlation = autocorrelation_panel(rows)
    if correlation is not None:
        text = "Autocorrelation of the same; shaded: the 95 % band of white noise."
        chart = Chart((correlation,), x_label="lag", x_unit="samples")
        pictures.append(album.chart(chart, text, f"Autocorrelation of: {alt}"))
    return pictures


def autocorrelation_panel(rows: Sequence[Residuals]) -> Panel | None:
    """Autocorrelation of each row over the lag; None where no row has samples enough."""
    lines = [(r, r_of_lag) for r in rows if (r_of_lag := autocorrelation(r.values)) is not None]
    if not lines:
        return None
    fewest = min(int(np.isfinite(r.values).sum()) for r, _ in lines)
    traces = tuple(Trace(r.label, np.arange(1.0, len(c) + 1), c, r.role, r.index) for r, c in lines)
    return Panel(
        "autocorrelation", "-", traces, band=WHITE_BAND / float(np.sqrt(fewest)), band_label="95 % of white noise"
    )


def autocorrelation(values: FloatArray) -> FloatArray | None:
    """Autocorrelation at the lags from 1 on; None with fewer than three samples, or where all are the same."""
    from statsmodels.tsa.stattools import acf

    finite = values[np.isfinite(values)]
    if len(finite) < 3 or np.ptp(finite) == 0:
        return None
    r: FloatArray = acf(values, nlags=min(ACF_LAGS, len(finite) - 1), fft=False, missing="conservative")[1:]
    return r
