"""The part of the run report on the limit: what the measurements say at best, and how far each estimator is from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.contracts.batch import INSEPARABLE, WELL_IDENTIFIED
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.metrics import rmse
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture, Table
from adaptive_flot.report.kit.wording import number, seed_list
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.cramer_rao_limit import MORE_SENSORS, TrueRun, has_limit, limits
from adaptive_flot.runner.scenario.realisation import Realisation

MOST_SEEDS = 3
"""Seeds whose bounds are computed; each takes about as long as a run."""


@dataclass(frozen=True)
class LimitPart:
    """What the template shows."""

    picture: Picture
    table: Table
    sentences: list[str]


@dataclass(frozen=True)
class _Bounds:
    """Smallest covariances (N, q, q) over the rows shown: with the driving outputs alone, and with more sensors."""

    alone: FloatArray
    more: FloatArray


def limit_part(case: CaseRuns, album: Album) -> LimitPart | None:
    """Bound beside the errors; None where the plant has not all that is estimated, or a bound can not be computed."""
    if not has_limit(case.scenario):
        return None
    sensors = _sensors(case)
    runs = [run for run in case.runs if run.seed in case.seeds[:MOST_SEEDS]]
    bounds = _bounds(case, runs, sensors)
    if not all(np.isfinite(b.alone).all() and np.isfinite(b.more).all() for b in bounds.values()):
        return None
    first = next(iter(case.first.values()))
    panels = _panels(case, bounds[first.estimator, first.seed], first)
    names = " and ".join(case.labels)
    caption = (
        f"{case.scenario.name}: size of the error of {names}, and its bound (1σ) with the driving outputs alone and "
        f"with {_spaced(sensors)} measured too"
        + ("; below, the correlation of the two smallest errors" if len(case.labels) > 1 else "")
        + f". Seed {first.seed}."
    )
    picture = album.chart(Chart(tuple(panels)), caption, f"Errors of {names} over time beside their bounds")
    return LimitPart(picture, _table(case, runs, bounds), _sentences(case, runs, bounds, sensors))


def _sensors(case: CaseRuns) -> dict[str, float]:
    """Further outputs that the plant has and that do not drive the adaptation yet."""
    known = case.scenario.plant_model.names("outputs")
    return {k: v for k, v in MORE_SENSORS.items() if k in known and k not in case.scenario.setup.outputs}


def _bounds(case: CaseRuns, runs: list[Run], sensors: Mapping[str, float]) -> dict[tuple[str, int], _Bounds]:
    """Bounds by estimator and seed; in open loop all estimators of a seed share them."""
    true: dict[bytes, TrueRun] = {}
    keys = {}
    for run in runs:
        columns = [q.column for q in case.scenario.model.inputs]
        inputs = run.table[[f"{c}_true" if f"{c}_true" in run.table else c for c in columns]].to_numpy()
        keys[run.estimator, run.seed] = key = run.seed.to_bytes(8, "little") + inputs.tobytes()
        true.setdefault(key, TrueRun(Realisation(case.scenario, run.seed), inputs))
    shown = runs[0].table["time_s"].to_numpy() > case.scenario.fits_after + 1e-9
    found = limits(list(true.values()), [{}, sensors])[:, :, shown]
    by_inputs = dict(zip(true, (_Bounds(*each) for each in found), strict=True))
    return {who: by_inputs[key] for who, key in keys.items()}


def _panels(case: CaseRuns, bound: _Bounds, first: Run) -> list[Panel]:
    model, time = case.scenario.model, case.shown(first)["time_s"].to_numpy()
    panels = []
    for i, (label, name) in enumerate(zip(case.labels, case.scenario.setup.parameters, strict=True)):
        traces = [
            Trace(who, time, np.abs(_error(case, case.first[who], label)), role, j)
            for who, (role, j) in case.roles.items()
            if role is Role.ESTIMATE and _error(case, case.first[who], label).any()
        ]
        traces.append(Trace("bound", time, np.sqrt(bound.alone[:, i, i]), Role.KNOWING))
        traces.append(Trace("bound, more sensors", time, np.sqrt(bound.more[:, i, i]), Role.CONSTANT, GREY))
        unit = model.parameters[model.index("parameters", name)].unit
        panels.append(Panel(f"|error| of {label}", unit, tuple(traces)))
    if len(case.labels) > 1:
        lines = (("bound", bound.alone, Role.KNOWING), ("bound, more sensors", bound.more, Role.CONSTANT))
        traces = [Trace(label, time, _correlation(P, 0, 1), role, GREY) for label, P, role in lines]
        panels.append(Panel("correlation at the bound", "-", tuple(traces), height=0.7))
    return panels


def _table(case: CaseRuns, runs: list[Run], bounds: Mapping[tuple[str, int], _Bounds]) -> Table:
    """Root mean square of bound and error, over time and seeds."""
    moving = [who for who, (role, _) in case.roles.items() if role is Role.ESTIMATE]
    rows = []
    for i, label in enumerate(case.labels):
        some = {run.seed: run for run in runs}  # in closed loop the bound of the last estimator's inputs
        size = rmse(np.concatenate([case.shown(r)[f"{label}_true"].to_numpy() for r in some.values()]))
        alone, more = (
            np.sqrt(np.mean([getattr(bounds[r.estimator, s], which)[:, i, i] for s, r in some.items()])) / size
            for which in ("alone", "more")
        )
        ratios = [number(_ratio(case, runs, bounds, who, i)) for who in moving]
        rows.append((label, number(100 * float(alone)), number(100 * float(more)), *ratios))
    caption = (
        f"Posterior Cramér–Rao bound of each parameter and root mean square error over it, {_seeds(runs)}. The bound "
        "is that of one who is told when each parameter begins and ends to move, but not where to: an estimator has to "
        "find that out as well, so it need not be reached. 1.00 is at the bound; a few seeds scatter around it."
    )
    heads = (
        "Parameter",
        "Bound [% of it]",
        "Bound, more sensors [% of it]",
        *(f"{who}: error / bound" for who in moving),
    )
    return Table(caption, heads, tuple(rows))


def _ratio(case: CaseRuns, runs: list[Run], bounds: Mapping[tuple[str, int], _Bounds], who: str, i: int) -> float:
    mine = [run for run in runs if run.estimator == who]
    error = rmse(np.concatenate([_error(case, run, case.labels[i]) for run in mine]))
    return float(error / np.sqrt(np.mean([bounds[who, run.seed].alone[:, i, i] for run in mine])))


def _sentences(
    case: CaseRuns, runs: list[Run], bounds: Mapping[tuple[str, int], _Bounds], sensors: Mapping[str, float]
) -> list[str]:
    """Whether the parameters can be told apart at each moment."""
    true = {run.seed: (run, bounds[run.estimator, run.seed]) for run in runs}.values()
    sentences = []
    for which, text in (("alone", "With the driving outputs alone"), ("more", f"With {_spaced(sensors)} too")):
        parts = []
        for i, label in enumerate(case.labels):
            known = [
                np.sqrt(getattr(b, which)[:, i, i]) <= WELL_IDENTIFIED * case.shown(r)[f"{label}_true"].abs().to_numpy()
                for r, b in true
            ]
            parts.append(f"{label} {np.mean(known):.0%}")
        sentence = f"{text}, the share of time in which a parameter can be known to 10 %: {', '.join(parts)}"
        for i, j in combinations(range(len(case.labels)), 2):
            r = np.concatenate([_correlation(getattr(b, which), i, j) for _, b in true])
            sentence += (
                f"; correlation of {case.labels[i]} and {case.labels[j]} {number(float(np.median(r)), '.3f')} in the "
                f"median, {INSEPARABLE} or more in size {np.mean(np.abs(r) >= INSEPARABLE):.0%} of the time, so that "
                f"{float(np.median(1 - r**2)):.1%} of the information on one is left where the other is unknown"
            )
        sentences.append(sentence + ".")
    return sentences


def _seeds(runs: list[Run]) -> str:
    return seed_list(dict.fromkeys(run.seed for run in runs))


def _error(case: CaseRuns, run: Run, label: str) -> FloatArray:
    table = case.shown(run)
    error: FloatArray = table[f"{label}_estimate"].to_numpy() - table[f"{label}_true"].to_numpy()
    return error


def _correlation(P: FloatArray, i: int, j: int) -> FloatArray:
    r: FloatArray = P[:, i, j] / np.sqrt(P[:, i, i] * P[:, j, j])
    return r


def _spaced(names: Mapping[str, float]) -> str:
    return " and ".join(f"{name.replace('_', ' ')} ({share:.0%} noise)" for name, share in names.items())
