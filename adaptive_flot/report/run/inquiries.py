"""The section of the run report on effects that were searched for while the loop ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Mark, Panel, Trace
from adaptive_flot.charts.units import amount
from adaptive_flot.greybox.model import FloatArray, Quantity
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.parts import Picture, Table
from adaptive_flot.report.kit.wording import joined, number, p_text, spaced
from adaptive_flot.report.run.control.closed_loop import colours
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
        "controller decided). Dotted lines: alarm, start of the search, and where the model was extended. " + which
    )
    picture = album.chart(_chart(case), caption, "Prediction errors over time, before and after the model was extended")
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
    tests = ", ".join(f"{name.replace('_', ' ')} (p {p_text(p)})" for name, p in i.p_values.items())
    began, ended = (number(t, "g") for t in i.record_s)
    changes = [
        f"the one-step error of {name.replace('_', ' ')}, noise included, goes from "
        f"{amount(before, units[name])} to {amount(after, units[name])}"
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


def _chart(case: CaseRuns) -> Chart:
    panels = [_step_panel(case, case.outputs[0])]
    if any(not run.plans.empty for run in case.first.values()):
        panels.append(_move_panel(case))
    marks = []
    for run in case.first.values():
        for i in run.inquiries or ():
            marks += [Mark(i.alarm_s, "alarm"), Mark(i.record_s[1], "search")]
            marks += [Mark(i.judged_s, "extended")] if i.extended else []
    return Chart(tuple(panels), marks=tuple(marks))


def told_at_the_top(cases: Sequence[CaseRuns]) -> list[str]:
    """What a search in the loop found, in a sentence each: for the first lines of page and console."""
    said = []
    for case in cases:
        units = {q.name: q.unit for q in case.scenario.model.outputs}
        for run in case.runs:
            for i in run.inquiries or ():
                kept = "the model in use was extended" if i.extended else f"the model in use was kept ({i.why})"
                errors = "; ".join(
                    f"one-step error of {spaced(name)}: {amount(before, units[name])} before, "
                    f"{amount(after, units[name])} after"
                    for name, (before, after) in i.errors.items()
                )
                said.append(
                    f"{run.estimator}, seed {run.seed}: at {number(i.judged_s, 'g')} s the search {_found(i)}; {kept}"
                    + (f"; {errors}." if errors else ".")
                )
    return said


def _found(i: Inquiry) -> str:
    """What a search found, without sizes."""
    if i.verdict is None:
        return "failed"
    effects = [f"{spaced(e.effect.site)} depends on {spaced(e.effect.driver)}" for e in i.verdict.effects]
    if effects:
        return f"found that {joined(effects)}, which the model lacks ({i.verdict.word})"
    return f"named nothing (verdict {i.verdict.word})"


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
