"""The section of the run report on effects that were searched for while the loop ran."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from adaptive_flot.greybox.model import FloatArray, Quantity
from adaptive_flot.report.kit import figures, style
from adaptive_flot.report.kit.page import Album, Picture, Table, number
from adaptive_flot.report.kit.plotdata import Panel, Trace
from adaptive_flot.report.run.closed_loop import colours
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.runner.adaptation.inquiry import Inquiry
from adaptive_flot.runner.results.prediction import one_move_errors, one_step_errors, rms

SMOOTHED_S = 120.0
"""Window of the moving root mean square error [s]."""


@dataclass(frozen=True)
class Watch:
    """What the template shows: what came of each alarm, how well each case predicted, and when."""

    inquiries: list[str]
    predictions: Table
    picture: Picture


def watch_section(case: CaseRuns, which: str, album: Album) -> Watch | None:
    """Section of a case of whose estimators one was watched; None where none was. `which` names the seed shown."""
    if all(run.inquiries is None for run in case.runs):
        return None
    caption = (
        f"{case.scenario.name}: error of the predicted {case.outputs[0].name.replace('_', ' ')}, root mean square over "
        f"{SMOOTHED_S:g} s (top: one sample ahead; below: predicted minus true at the end of each move that the "
        "controller decided). Lines: alarm (dotted), start of the search (dashed), model extended (solid). " + which
    )
    picture = album.add(_figure(case), caption, "Prediction errors over time, before and after the model was extended")
    return Watch(_sentences(case), _prediction_table(case), picture)


def _sentences(case: CaseRuns) -> list[str]:
    """What came of each alarm, a paragraph each."""
    sentences = []
    for run in case.runs:
        who = f"{run.estimator}, seed {run.seed}"
        sentences += [f"{who}: {_sentence(case, i)}" for i in run.inquiries or ()]
        if run.inquiries is not None and not run.inquiries:
            sentences.append(f"{who}: no search ended within the run.")
    return sentences


def _sentence(case: CaseRuns, i: Inquiry) -> str:
    units = {q.name: q.unit for q in case.scenario.model.outputs}
    tests = ", ".join(f"{name.replace('_', ' ')} (p {figures.p_text(p)})" for name, p in i.p_values.items())
    began, ended = (number(t, "g") for t in i.record_s)
    changes = [
        f"the one-step error of {name.replace('_', ' ')}, noise included, goes from "
        f"{style.amount(before, units[name])} to {style.amount(after, units[name])}"
        for name, (before, after) in i.errors.items()
    ]
    held_out = f"the held-out rows from {ended} to {number(i.judged_s, 'g')} s"
    judged = f"; on {held_out} {', '.join(changes)}"
    return (
        f"at {number(i.alarm_s, 'g')} s the innovations were no longer white: {tests}. The record from {began} to "
        f"{ended} s was searched; verdict at {number(i.judged_s, 'g')} s: {_told(i)}. The model in use was "
        + ("extended" if i.extended else f"kept ({i.why})")
        + (f"{judged}." if changes else ".")
    )


def _told(i: Inquiry) -> str:
    if i.verdict is None:
        return "none, the search failed"
    effects = []
    for e in i.verdict.effects:
        sizes = ", ".join(f"{name} {value:.3g}" for name, value in e.effect.coefficients.items())
        effects.append(f"{e.effect.site} depends on {e.effect.driver} ({e.effect.form}: {sizes})")
    return f"{i.verdict.word}, {'; '.join(effects)}" if effects else i.verdict.word


def _prediction_table(case: CaseRuns) -> Table:
    output = case.outputs[0]
    rows = []
    for who in case.roles:
        runs = case.of(who)
        ahead = [one_move_errors(case.shown(run), run.plans)["error"].to_numpy(dtype=float) for run in runs]
        step = [rms(one_step_errors(case.shown(run), output.column)) for run in runs]
        off = [np.median(_offsets(case, who, label)) for label in case.labels]
        rows.append(
            (
                who,
                number(float(np.median(step)), ".2e"),
                number(float(np.median([rms(e) for e in ahead])), ".2e"),
                *(number(100 * float(v), "+.1f") for v in off),
            )
        )
    name = output.name.replace("_", " ")
    labels = [f"{x} off by [%]" for x in case.labels]
    header = ("Estimator", f"{name}, one sample ahead", "grade, one move ahead", *labels)
    caption = (
        f"Root mean square error of the predictions over t > {case.scenario.fits_after:g} s against the truth, and "
        "by how much the adapted parameters differ from the truth (what they absorb of an effect that the model "
        "lacks); medians over the seeds, of the parameters over time too."
    )
    return Table(caption, header, tuple(rows))


def _offsets(case: CaseRuns, who: str, label: str) -> FloatArray:
    tables = [case.shown(run) for run in case.of(who)]
    ratios: FloatArray = np.concatenate([(t[f"{label}_estimate"] / t[f"{label}_true"] - 1).to_numpy() for t in tables])
    return ratios[np.isfinite(ratios)] if np.isfinite(ratios).any() else np.full(1, np.nan)


def _figure(case: CaseRuns) -> Figure:
    output = case.outputs[0]
    panels = [_step_panel(case, output)]
    if any(not run.plans.empty for run in case.first.values()):
        panels.append(_move_panel(case))
    figure = figures.time_figure(panels)
    for run in case.first.values():
        for i in run.inquiries or ():
            for ax in figure.axes:
                for time, dashes in ((i.alarm_s, ":"), (i.record_s[1], "--")):
                    ax.axvline(time, color=style.LIMIT, ls=dashes, lw=1.0, zorder=1)
                if i.extended:
                    ax.axvline(i.judged_s, color=style.LIMIT, lw=1.2, zorder=1)
    return figure


def _step_panel(case: CaseRuns, output: Quantity) -> Panel:
    traces = []
    rows = max(1, round(SMOOTHED_S / case.scenario.dt))
    for who, (role, j) in colours(case).items():
        table = case.first[who].table
        squares = (table[f"{output.column}_predicted"] - table[f"{output.column}_true"]) ** 2
        moving = np.sqrt(squares.rolling(rows, min_periods=rows // 2).mean()).to_numpy()
        traces.append(Trace(who, table["time_s"].to_numpy(), moving, role, j))
    return Panel("one sample ahead", output.unit, tuple(traces), height=1.2)


def _move_panel(case: CaseRuns) -> Panel:
    traces = []
    for who, (role, j) in colours(case).items():
        run = case.first[who]
        errors = one_move_errors(run.table, run.plans)
        traces.append(Trace(who, errors["time_s"].to_numpy(), errors["error"].to_numpy(), role, j))
    return Panel("one move ahead", "-", tuple(traces), height=1.2)
