"""Figures: what they show and what they withstand."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.report.kit import distributions, figures, style
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.heat import HeatMap
from adaptive_flot.report.kit.plotdata import Residuals, Spread
from adaptive_flot.report.kit.residuals import autocorrelation, residual_pictures
from adaptive_flot.runner.results.whiteness import ljung_box_p

TIME = np.arange(1.0, 401.0)


def residuals(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Residuals:
    return Residuals("rpem", Role.ESTIMATE, 0, TIME, values, ljung_box_p(values))


def test_time_figure_takes_the_power_of_ten_into_the_label() -> None:
    values = np.where(TIME < 50, np.nan, 6.38e-4)
    trace = Trace("rpem", TIME, values, Role.ESTIMATE, std=np.full(400, 1e-5))
    figure = figures.time_figure([Panel("C", "m^n/s", (trace,))])
    (ax,) = figure.axes
    assert ax.get_ylabel() == "C\n[10⁻⁴ mⁿ/s]"
    assert ax.get_xlabel() == "time [s]"
    assert ax.get_xlim() == (0.0, 400.0)
    assert np.nanmax(ax.lines[0].get_ydata()) == pytest.approx(6.38)
    assert len(ax.collections) == 1  # the band


def test_zoom_follows_the_estimates_not_the_constant() -> None:
    traces = (
        Trace("fixed", TIME, np.full(400, -5.0), Role.CONSTANT),
        Trace("rpem", TIME, np.full(400, 0.1), Role.ESTIMATE),
    )
    figure = figures.time_figure([Panel("error", "-", traces, zoom=True)])
    low, high = figure.axes[0].get_ylim()
    assert -1.0 < low < 0.1 < high < 1.0


def test_each_chart_has_its_own_picture_for_readers_without_scripts() -> None:
    """They are drawn last, by several processes: each must come back to its place, as it is drawn alone."""
    charts = [Chart((Panel(name, "-", (Trace("a", TIME, k * TIME, Role.ESTIMATE),)),)) for k, name in enumerate("pqr")]
    album = Album()
    album.heat(HeatMap("", ("a",), ()), "a map between them has none", "")
    pictures = [album.chart(chart, f"chart {k}", "") for k, chart in enumerate(charts)]
    stills = album.stills()
    assert list(stills) == [album.pictures.index(p) for p in pictures] == [1, 2, 3]
    assert list(stills.values()) == [style.data_uri(figures.chart_figure(c), small=True) for c in charts]
    assert len(set(stills.values())) == 3


@pytest.mark.parametrize("values", [np.full(400, np.nan), np.zeros(400), np.r_[np.full(398, np.nan), 1.0, 2.0]])
def test_residuals_of_poor_data_have_no_autocorrelation(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    album = Album()
    assert len(residual_pictures([residuals(values)], "c", "a", album)) == 1
    assert "null" in album.blocks()[0] or np.isfinite(values).all()


def test_autocorrelation_leaves_missing_samples_out() -> None:
    """An alternating series is negative at the odd lags and positive at the even ones, whatever is missing."""
    values = np.resize([1.0, -1.0], 4000)
    values[::7] = np.nan
    found = autocorrelation(values)
    assert found is not None
    np.testing.assert_allclose(found[:6], [-1, 1, -1, 1, -1, 1], atol=0.2)  # the estimate shrinks with what is missing


def test_spread_figure_marks_the_published_value() -> None:
    spread = Spread("n", {"rpem": np.array([97.0, np.nan, 98.0])}, {"rpem": 97.99})
    figure = distributions.spread_figure([spread], {"rpem": (Role.ESTIMATE, 0), "none": (Role.CONSTANT, 0)})
    assert any(97.99 in np.asarray(line.get_xdata()) for line in figure.axes[0].lines)


def test_large_figures_become_png(monkeypatch: pytest.MonkeyPatch) -> None:
    figure = figures.time_figure([Panel("n", "-", (Trace("rpem", TIME, TIME, Role.ESTIMATE),))])
    assert style.data_uri(figure).startswith("data:image/svg+xml,")
    monkeypatch.setattr(style, "LARGEST_SVG", 10)
    assert style.data_uri(figure).startswith("data:image/png;base64,")


def test_look_stays_inside_the_report() -> None:
    before = dict(matplotlib.rcParams)
    figures.time_figure([Panel("n", "-", (Trace("rpem", TIME, TIME, Role.ESTIMATE),))])
    assert dict(matplotlib.rcParams) == before
