"""A chart as a JSON block: the only thing that the scripts of a page read."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from adaptive_flot.charts.palette import SLOTS, STATES
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Strip, Trace
from adaptive_flot.charts.thinning import fair_share, kept_rows
from adaptive_flot.charts.units import exponent, time_unit, unit_text
from adaptive_flot.greybox.quantities import FloatArray

MOST_VALUES = 160_000
"""Values on one page; about 7 bytes each."""
DIGITS = 4
"""Digits of a value, counted from the range of its line."""

Group = list[tuple[int, Trace]]


def blocks(charts: Sequence[Chart], budget: int = MOST_VALUES) -> list[str]:
    """JSON of each chart of a page, its lines thinned where the page would be too large; safe inside a script element.

    Parameters
    ----------
    charts
        The charts, in order.
    budget
        Values of all of them together.
    """
    groups = [g for chart in charts for panel in chart.panels for g in _groups(panel)]
    sizes = [(len(g[0][1].time), 1 + sum(1 + (t.std is not None) for _, t in g)) for g in groups]
    most = fair_share(sizes, budget)
    return [_escaped(json.dumps(block(chart, most), separators=(",", ":"), allow_nan=False)) for chart in charts]


def block(chart: Chart, most: int) -> dict[str, Any]:
    """Content of one chart's block, of which each line keeps `most` rows or fewer."""
    low, high = chart.limits()
    unit, seconds = time_unit(high - low) if chart.over_time else (unit_text(chart.x_unit), 1.0)
    return {
        "x": {"label": chart.x_label, "unit": unit, "seconds": seconds, "time": chart.over_time, "range": [low, high]},
        "panels": [_lines(panel, most) for panel in chart.panels] + ([_strips(chart.strips)] if chart.strips else []),
        "marks": [{"x": m.time, "label": m.label} for m in chart.marks],
    }


def _groups(panel: Panel) -> list[Group]:
    """Lines of a panel that share their times, each with its place in the panel."""
    groups: list[Group] = []
    for place, trace in enumerate(panel.traces):
        group = next((g for g in groups if np.array_equal(g[0][1].time, trace.time)), None)
        if group is None:
            groups.append([(place, trace)])
        else:
            group.append((place, trace))
    return groups


def _lines(panel: Panel, most: int) -> dict[str, Any]:
    power = exponent(*(t.values for t in panel.followed() or panel.traces), np.array(panel.limits))
    factor = 10.0**-power
    axes, series = [], []
    for k, group in enumerate(_groups(panel)):
        rows = kept_rows([t.values for _, t in group], most)
        axes.append(numbers(group[0][1].time[rows], exact=True))
        series += [(place, _series(t, k, rows, factor)) for place, t in group]
    zoom = panel.zoom_limits()
    return {
        "kind": "lines",
        "label": panel.label,
        "unit": unit_text(panel.unit, power),
        "height": panel.height,
        "limits": [limit * factor for limit in panel.limits],
        "range": None if zoom is None else [end * factor for end in zoom],
        "band": None if panel.band is None else {"half": panel.band * factor, "label": panel.band_label},
        "x": axes,
        "series": [s for _, s in sorted(series, key=lambda pair: pair[0])],
    }


def _series(trace: Trace, axis: int, rows: np.ndarray[Any, Any], factor: float) -> dict[str, Any]:
    content: dict[str, Any] = {
        "label": trace.label,
        "x": axis,
        **look(trace.role, trace.index),
        "step": trace.held,
        "y": numbers(trace.values[rows] * factor),
    }
    if trace.std is not None and np.any(np.nan_to_num(trace.std) > 0):
        content["std"] = numbers(trace.std[rows] * factor)
    return content


def look(role: Role, index: int) -> dict[str, Any]:
    """Name of the colour, width [px] and dashes [px] of a line; dashes tell roles apart where colours can not."""
    own = f"slot-{index % len(SLOTS)}"
    return {
        Role.TRUTH: {"color": "truth", "width": 1.25, "dash": ([], [5, 4], [2, 3], [7, 3, 2, 3])[index % 4]},
        Role.CONSTANT: {"color": own, "width": 1.75, "dash": [7, 3]},
        Role.ESTIMATE: {"color": own, "width": 1.5, "dash": []},
        Role.KNOWING: {"color": "truth", "width": 1.25, "dash": [5, 4]},
        Role.FOLLOWED: {"color": own, "width": 1.0, "dash": [2, 3]},
        Role.PLAN: {"color": "plan", "width": 1.25, "dash": []},
    }[role]


def _strips(strips: Sequence[Strip]) -> dict[str, Any]:
    unusual = state_slots(strips)
    looks = {state: f"state-{slot}" for state, slot in unusual.items()}
    return {
        "kind": "strips",
        "rows": [
            {
                "label": s.label,
                "spells": [[state.replace("_", " "), a, b, looks.get(state, "usual")] for state, a, b in s.spells()],
            }
            for s in strips
        ],
        "states": [["usual", " / ".join(dict.fromkeys(s.usual for s in strips)).replace("_", " ")]]
        + [[look, state.replace("_", " ")] for state, look in looks.items()],
    }


def state_slots(strips: Sequence[Strip]) -> dict[str, int]:
    """Colour of each state that is not the usual one of its strip."""
    unusual = dict.fromkeys(s for strip in strips for s in strip.states if s != strip.usual)
    return {state: i % STATES for i, state in enumerate(unusual)}


def numbers(values: FloatArray, exact: bool = False) -> dict[str, Any]:
    """Values as whole steps from the smallest, with `DIGITS` digits of their range; `exact` for times, to a ms.

    >>> numbers(np.array([0.0, 1.0, 2.0]), exact=True), numbers(np.array([0.5, np.nan, 0.6]))
    ({'o': 0.0, 's': 1.0, 'n': 3}, {'o': 0.5, 's': 1e-05, 'v': [0, None, 10000]})
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return {"o": 0.0, "s": 1.0, "v": [None] * len(values)}
    low, size = float(known.min()), float(np.ptp(known))
    steps = np.diff(values)
    if exact and len(values) > 1 and steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-6, atol=0.0):
        return {"o": low, "s": size / (len(values) - 1), "n": len(values)}
    step = (_time_step(steps) if exact else 10.0 ** (np.floor(np.log10(size)) - DIGITS)) if size > 0 else 1.0
    whole = np.round((values - low) / step)
    return {"o": low, "s": float(step), "v": [None if np.isnan(v) else int(v) for v in whole.tolist()]}


def _time_step(steps: FloatArray) -> float:
    """Smallest step between times where the others are multiples of it, else a millisecond."""
    least = float(np.min(np.abs(steps), initial=np.inf, where=steps != 0))
    return least if np.isfinite(least) and np.allclose(steps / least, np.round(steps / least), atol=1e-3) else 1e-3


def _escaped(text: str) -> str:
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
