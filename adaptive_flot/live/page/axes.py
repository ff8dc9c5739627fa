"""The panels over time: which lines they have, and the numbers of a cycle for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.contracts import Plan, Status
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.running.progress import Progress

HELD = (Status.LOW_INFORMATION, Status.MISSING, Status.NOT_FINITE, Status.TOO_OLD, Status.INITIALISING)
"""An estimate with one of these has learned nothing from its sample."""
MEASURED, OWN, PLANNED, LIMIT, GREY = "slot-9", "slot-0", "plan", "limit", "slot-8"


def plain(value: float, digits: int = 6) -> float | None:
    """A number for JSON; None where there is none.

    >>> plain(0.12345678), plain(float("nan"))
    (0.123457, None)
    """
    return float(f"{value:.{digits}g}") if math.isfinite(value) else None


def is_share(q: Quantity) -> bool:
    """Whether a quantity is a share, which is shown in per cent."""
    return q.unit == "-" and q.upper <= 1.0


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: label, unit, and what its value is multiplied with."""

    label: str
    unit: str
    factor: float

    @classmethod
    def of(cls, name: str, unit: str, sizes: tuple[float, ...], share: bool = False) -> Shown:
        """Shares are shown in per cent, others with a power of ten where they are small or large."""
        label = name.replace("_", " ").capitalize()
        if share:
            return cls(label, "%", 100.0)
        power = exponent(np.array(sizes))
        return cls(label, unit_text(unit, power), 10.0**-power)


@dataclass(frozen=True)
class Line:
    """One line: what it shows in words, its colour, dashes, and whether it is held from value to value."""

    label: str
    color: str
    dash: tuple[int, ...] = ()
    step: bool = False
    band: bool = False


@dataclass(frozen=True)
class Axis:
    """One panel."""

    name: str
    kind: str
    shown: Shown
    lines: tuple[Line, ...]
    limits: tuple[float, ...] = ()
    column: int = 0
    twin: int | None = None


class Axes:
    """The panels of a link: limited outputs, moved inputs, adapted parameters.

    Parameters
    ----------
    link
        The link file and its scenario.
    """

    def __init__(self, link: Link) -> None:
        scenario = link.scenario
        model, limits = scenario.model, scenario.limits
        assert limits is not None  # no link without
        self.axes: list[Axis] = []
        for name, (low, high) in limits.outputs.items():
            j = model.index("outputs", name)
            q = model.outputs[j]
            shown = Shown.of(name, q.unit, (low, high), is_share(q))
            ends = tuple(shown.factor * end for end in (low, high) if math.isfinite(end))
            lines: tuple[Line, ...] = (
                Line("measured", MEASURED),
                Line("predicted", OWN),
                Line("plan", PLANNED),
            )
            self.axes.append(Axis(name, "output", shown, lines, ends, j))
        for name, write in link.file.writes.items():
            q = model.inputs[model.index("inputs", name)]
            shown = Shown.of(name, q.unit, (write.low, write.high))
            measured = name.removesuffix("_setpoint")
            twin = model.names("outputs").index(measured) if measured in model.names("outputs") else None
            lines = (
                Line("set-point", OWN, step=True),
                Line("bounds", LIMIT, (7, 3), step=True),
                Line("bounds", LIMIT, (7, 3), step=True),
                *(() if twin is None or measured == name else (Line("measured", MEASURED),)),
                Line("plan", PLANNED, step=True),
            )
            self.axes.append(Axis(name, "input", shown, lines, (), model.index("inputs", name), twin))
        for k, full in enumerate(scenario.setup.parameters):
            p = model.parameters[model.index("parameters", full)]
            shown = Shown.of(p.symbol or p.name, p.unit, (p.value,))
            shown = Shown(p.symbol or p.name, shown.unit, shown.factor)
            lines = (Line("estimate", OWN, band=True), Line("held", GREY, band=True))
            self.axes.append(Axis(full, "parameter", shown, lines, (), k))

    def spec(self) -> list[dict[str, Any]]:
        """The panels for the page."""
        return [
            {
                "name": axis.name,
                "label": axis.shown.label,
                "unit": axis.shown.unit,
                "limits": list(axis.limits),
                "lines": [
                    {"label": x.label, "color": x.color, "dash": list(x.dash), "step": x.step, "band": x.band}
                    for x in axis.lines
                    if x.label != "plan"
                ],
                "planned": any(x.label == "plan" for x in axis.lines),
                "steps": axis.kind == "input",
            }
            for axis in self.axes
        ]

    def row(self, progress: Progress) -> list[float | None]:
        """Numbers of a cycle, line after line; a line with a band has two, its value and its standard deviation."""
        found: list[float] = []
        for axis in self.axes:
            values = {"output": self._output, "input": self._input, "parameter": self._parameter}[axis.kind]
            found += [axis.shown.factor * v for v in values(axis, progress)]
        return [plain(v) for v in found]

    def plan(self, plan: Plan) -> dict[str, list[float | None]]:
        """What the controller expects of each panel's quantity, by its name."""
        known: Mapping[str, Any] = {**plan.inputs, **plan.outputs}
        return {a.name: [plain(a.shown.factor * v) for v in known[a.name]] for a in self.axes if a.name in known}

    @staticmethod
    def _output(axis: Axis, progress: Progress) -> list[float]:
        sample, estimate = progress.outcome.sample, progress.outcome.estimate
        return [
            math.nan if sample is None else float(sample.outputs[axis.column]),
            math.nan if estimate is None else float(estimate.prediction[axis.column]),
        ]

    @staticmethod
    def _input(axis: Axis, progress: Progress) -> list[float]:
        sample = progress.outcome.sample
        low, high = progress.snapshot.operator.get(axis.name, (math.nan, math.nan))
        found = [progress.outcome.acting.get(axis.name, math.nan), low, high]
        if axis.twin is not None:
            found.append(math.nan if sample is None else float(sample.outputs[axis.twin]))
        return found

    @staticmethod
    def _parameter(axis: Axis, progress: Progress) -> list[float]:
        estimate, k = progress.outcome.estimate, axis.column
        if estimate is None:
            return [math.nan] * 4
        value, std = float(estimate.parameters[k]), math.sqrt(max(float(estimate.covariance[k, k]), 0.0))
        nothing = [math.nan, math.nan]
        return [*nothing, value, std] if estimate.status in HELD else [value, std, *nothing]
