"""The chapter of the discovery report on the test that would tell the leading alternatives apart."""

from __future__ import annotations

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.discovery.results import Experiment
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.report.discovery.tables import effect_text
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Part, Table, Text
from adaptive_flot.report.kit.wording import number, spaced

MOST_OUTPUTS = 3
"""Outputs whose predictions are drawn: those in which the alternatives differ most, in units of the noise."""


def experiment_chapter(planned: Experiment, model: Model, columns: tuple[int, ...], album: Album) -> list[Part]:
    """Parts of the chapter; `columns` are the measured outputs of the model."""
    picture = album.chart(
        Chart(tuple(_panels(planned, model, columns))),
        "The proposed test, and what each alternative predicts for it. Shaded: two standard deviations of the noise of "
        "one sample, around the best alternative.",
        "Inputs of the proposed test and the predictions of each alternative",
    )
    return [
        Text(f"{planned} It would go on where the record ends."),
        picture,
        _moves(planned),
        _power(planned),
        _pairs(planned),
        _tried(planned),
    ]


def _moves(planned: Experiment) -> Table:
    inputs = np.array([u for _, u in planned.moves()])
    powers = [exponent(inputs[:, j]) for j in range(inputs.shape[1])]
    header = ("Time [s]", *(f"{spaced(n)} [{unit_text(u, p)}]" for (n, u), p in _named(planned, powers)))
    rows = [
        (f"{time:g}", *(number(v * 10.0**-p, ".4g") for v, p in zip(u, powers, strict=True)))
        for time, u in planned.moves()
    ]
    return Table(
        f"Moves of the test ({planned.name}): each value is held until the next.", header, tuple(rows), words=0
    )


def _named(planned: Experiment, powers: list[int]) -> list[tuple[tuple[str, str], int]]:
    return list(zip(planned.quantities, powers, strict=True))


def _power(planned: Experiment) -> Table:
    rows = tuple((effect_text(n), number(100 * p, ".0f")) for n, p in zip(planned.compared, planned.power, strict=True))
    caption = (
        "Power of this test: it was simulated with each alternative as the truth, with noise and uncertain parameters. "
        "Share of these simulations that tell the truth from all others."
    )
    return Table(caption, ("If this is true", "told [%]"), rows)


def _pairs(planned: Experiment) -> Table:
    rows = tuple((effect_text(p.one), effect_text(p.other), number(p.separation, ".1f")) for p in planned.pairs)
    caption = (
        "Expected separation of each pair by this test: about how much worse the criterion of the wrong one would be, "
        "after all that the uncertainty of both fits and a drift of the adapted parameters can hide. "
        f"{planned.needed:.0f} is the least that tells two apart."
    )
    return Table(caption, ("One", "Other", "Separation"), rows, words=2)


def _tried(planned: Experiment) -> Table:
    rows = tuple((t.name, number(t.separation, ".1f")) for t in planned.tried)
    return Table("Every test tried, by its closest pair.", ("Test", "Separation of the closest pair"), rows)


def _panels(planned: Experiment, model: Model, columns: tuple[int, ...]) -> list[Panel]:
    time: FloatArray = planned.dt * np.arange(1.0, len(planned.inputs) + 1)
    panels = [
        Panel(spaced(name), unit, (Trace("", time, planned.inputs[:, j], Role.TRUTH, held=True),), height=0.6)
        for j, (name, unit) in enumerate(planned.quantities)
        if np.ptp(planned.inputs[:, j]) > 0
    ]
    for j in _telling(planned):
        q = model.outputs[columns[j]]
        traces = []
        for k, (names, y) in enumerate(zip(planned.compared, planned.predicted, strict=True)):
            std = np.full(len(time), planned.noise[j]) if k == 0 else None
            traces.append(Trace(effect_text(names), time, y[:, j], Role.ESTIMATE, k, std))
        panels.append(Panel(spaced(q.name), q.unit, tuple(traces)))
    return panels


def _telling(planned: Experiment) -> list[int]:
    spread: FloatArray = np.std(np.array(planned.predicted), axis=0)  # (N, m)
    size = np.sqrt(np.mean(spread**2, axis=0)) / planned.noise
    return [int(j) for j in np.argsort(-size)[:MOST_OUTPUTS]]
