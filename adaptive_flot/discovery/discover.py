"""Discover: a record and a model in, a verdict out. The stages of the search, one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.assessment.detect import detect
from adaptive_flot.discovery.assessment.explained import nothing_explained
from adaptive_flot.discovery.assessment.verification import changes, whiteness
from adaptive_flot.discovery.candidates.direction import against, listed
from adaptive_flot.discovery.fitting.base_fit import prepare, split_record
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.fitting.node_spacing import at_every_row
from adaptive_flot.discovery.fitting.parallel import one_thread
from adaptive_flot.discovery.record.problem import CYCLE, WITHOUT_REPORT, Problem
from adaptive_flot.discovery.record.screening import Screening, screen
from adaptive_flot.discovery.search.alternatives import Alternative
from adaptive_flot.discovery.search.common_nuisance import adjust_for_common_nuisance
from adaptive_flot.discovery.search.joint_search import search_jointly, wants_joint
from adaptive_flot.discovery.search.search import Search, search
from adaptive_flot.discovery.test_design.experiment import leading, plan_experiment
from adaptive_flot.discovery.test_design.signals import input_range
from adaptive_flot.discovery.verdict.locate import locate
from adaptive_flot.discovery.verdict.verdict import (
    LEAST_MARGIN,
    Judgement,
    NamedEffect,
    Verdict,
    held_up,
    judge,
    undecided_rivals,
)
from adaptive_flot.discovery.verdict.wording import drift_words, reason_words
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.record import RecordSimulator


@dataclass(frozen=True)
class Discovery:
    """The verdict and everything behind it.

    Attributes
    ----------
    verdict
        What to tell.
    model
        The model with what was named (or the unnamed curve) added, fitted; the plain fitted model else.
    screening, problem, search, judgement
        The stages; None from the one that was not reached.
    before, after
        Fits of the plain and of the extended model to the estimation and confirm splits.
    """

    verdict: Verdict
    model: Model
    screening: Screening
    problem: Problem | None = None
    search: Search | None = None
    judgement: Judgement | None = None
    before: Fit | None = None
    after: Fit | None = None


@one_thread()
def discover(
    model: Model,
    record: Dataset,
    *,
    adapted: Sequence[str] = (),
    report_record: Dataset | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
) -> Discovery:
    """Find what physical effect a model lacks, from a measured record.

    Parameters
    ----------
    model
        The model, with sites; its parameters of role "estimated" are free in every alternative.
    record
        Measured record, from `read_dataset`.
    adapted
        Names of the free parameters instead of those of role "estimated".
    report_record
        A further record of the same process that starts in the same (unknown) state. It reports the error before and
        after and is used for nothing else; the whole of `record` can then be used to search.
    limits
        Lowest and highest value of inputs by name, for the test that is proposed; where it is not given, the test
        stays where the record has been.
    processes
        Fits that run at once.
    progress
        Called with a word for each stage.

    Returns
    -------
    Discovery
        The verdict, the extended model and all stages.

    Raises
    ------
    ModelError
        No site, no parameter of that name, or a limit that does not fit the inputs.
    """
    began = time.perf_counter()
    if not model.sites:
        raise ModelError(f"model '{model.name}' has no sites; pass its physical quantities through Scope.site")
    if limits:
        input_range(record.inputs, model.inputs, limits)  # a wrong limit is told before the search
    names = model.expand_parameters(adapted or [p.name for p in model.parameters if p.role == "estimated"])
    progress("check the data")
    checked = screen(record, model)
    if checked.reasons:
        return Discovery(_insufficient(checked, began), model, checked)
    progress("fit the model as it is")
    problem, checked = split_record(checked, model, names, CYCLE if report_record is None else WITHOUT_REPORT)
    if checked.reasons:
        return Discovery(_insufficient(checked, began), model, checked)
    prepared = prepare(problem, model)
    if prepared is None:
        reason = f"the model can not simulate the record: check the units of its columns and the model '{model.name}'"
        checked = replace(checked, reasons=(reason,))
        return Discovery(_insufficient(checked, began), model, checked)
    problem, base = prepared
    unexplained = nothing_explained(problem, base)
    if unexplained:
        checked = replace(checked, reasons=(unexplained,))
        return Discovery(_insufficient(checked, began), base.model, checked, problem, before=base, after=base)
    progress("test the residual")
    detection = detect(problem, base)
    found = search(problem, base, model, processes=processes, progress=progress)
    if wants_joint(problem, found):
        problem, found = search_jointly(problem, found, processes=processes, progress=progress)
        base = found.base
    if problem.whiten and (rivals := undecided_rivals(found)):
        progress("compare with a common nuisance")
        found = adjust_for_common_nuisance(problem, found, rivals, processes)
    found, judgement = held_up(problem, found, judge(found))
    progress("fit once more, without the report split")
    before, after = _final(problem, base, judgement.best)
    verdict = _verdict(problem, checked, found, judgement, before, after, report_record)
    verdict = replace(verdict, detection=detection, location=locate(detection, found.rounds[0].scores))
    if judgement.best is not None and judgement.word != "none":
        progress("plan a test")
        compared = [
            replace(a, fit=Fitter(problem).with_intervals(a.fit))
            for a in leading(judgement.best, found.alternatives, judgement.margin)
        ]
        planned = plan_experiment(problem, compared, LEAST_MARGIN, limits, processes)
        verdict = replace(verdict, experiment=planned)
    extended = after.model if judgement.word in ("named", "class", "unnamed") else before.model
    verdict = replace(verdict, seconds=time.perf_counter() - began)
    return Discovery(verdict, extended, checked, problem, found, judgement, before, after)


def _final(problem: Problem, base: Fit, best: Alternative | None) -> tuple[Fit, Fit]:
    """Fits to all rows but the report split, run at every row: of the model as it is, and of the best alternative."""
    splits = ("estimate", "confirm")
    fitter, every = Fitter(problem, splits), Fitter(replace(problem, nodes=None), splits)

    def final(fit: Fit) -> Fit:
        again = fitter.fit(fit.model, fit.names, like=fit, rounds=2) or fit
        return every.with_intervals(at_every_row(fitter, again, {}))

    before = final(base)
    return before, before if best is None else final(best.fit)


def on_record(problem: Problem, record: Dataset, before: Fit, after: Fit) -> tuple[Problem, Fit, Fit]:
    """Free runs of fits over another record from their own initial state: its problem and the fits with them."""
    n, columns = len(record), list(problem.columns)
    everywhere = np.full(n, "report", dtype="<U8")
    weights = np.ones((n, len(columns)))
    there = replace(problem, record=record, splits=everywhere, weights=weights)

    def run(fit: Fit) -> Fit:
        free = RecordSimulator(fit.model, record.dt).outputs(record, fit.initial_state, fit.model.parameter_values)
        return replace(fit, predicted=free[:, columns])

    return there, run(before), run(after)


def _insufficient(checked: Screening, began: float) -> Verdict:
    reason = "The record does not say enough: " + "; ".join(checked.reasons) + "."
    return Verdict("insufficient", reason, notes=checked.notes, seconds=time.perf_counter() - began)


def _verdict(
    problem: Problem,
    checked: Screening,
    found: Search,
    judgement: Judgement,
    before: Fit,
    after: Fit,
    report: Dataset | None,
) -> Verdict:
    tells = judgement.word in ("named", "class", "unnamed")
    final = after if tells or judgement.best is not None else before
    labels = [after.model.parameters[after.model.index("parameters", n)].label for n in problem.adapted]
    count = len(labels)
    absorbed = {
        k: float(b / a - 1) if a else float("nan")
        for k, b, a in zip(labels, before.values[:count], final.values[:count], strict=True)
    }
    tests = {f"ljung_box_before_{k}": p for k, p in whiteness(problem, before, raw=True).items()}
    tests |= {f"ljung_box_after_{k}": p for k, p in whiteness(problem, final, raw=True).items()}
    first = before.model.outputs[problem.columns[0]].name
    tests |= {f"ljung_box_{k}": tests.get(f"ljung_box_{k}_{first}", float("nan")) for k in ("before", "after")}
    effects = _effects(judgement, after) if tells else ()
    drift = drift_words(judgement, after) if judgement.word == "none" and judgement.best else ()
    error = changes(problem, before, final, "report")
    if report is not None:
        there, old, new = on_record(problem, report, before, final)
        error = changes(there, old, new, "report")
    return Verdict(
        word=judgement.word,
        reason=reason_words(judgement, found, effects, drift),
        effects=effects,
        members=judgement.members,
        error=error,
        report_times=problem.spans("report") if report is None else (),
        tests=tests,
        parameters=dict(zip(labels, map(float, final.values[:count]), strict=True)),
        drift=drift,
        absorbed=absorbed,
        notes=checked.notes + _common_nuisance_note(found),
    )


def _common_nuisance_note(found: Search) -> tuple[str, ...]:
    if found.common_nuisance is None:
        return ()
    site, driver = found.common_nuisance
    return (f"close alternatives were compared with what they leave, {site} by {driver}, added to each",)


def _effects(judgement: Judgement, after: Fit) -> tuple[NamedEffect, ...]:
    assert judgement.best is not None  # a verdict that names has an alternative
    model, best = after.model, judgement.best
    std = dict(zip(after.names, after.std(), strict=True))
    found = []
    for i, effect in enumerate(model.fitted_effects()[-len(best.names) :]):
        own = best.names[i]
        others = tuple(
            (*instead[0], a.worse_than(best), a.loglik_difference_sd)
            for a in judgement.rivals
            if len(instead := [n for n in a.names if n not in best.names]) == 1
            and set(best.names) - set(a.names) == {own}
        )
        interval = {
            c: (v - 1.96 * std[effect.parameter(c)], v + 1.96 * std[effect.parameter(c)])
            for c, v in effect.coefficients.items()
            if effect.parameter(c) in std
        }
        found.append(NamedEffect(effect, _meaning(model, effect), interval, others))
    return tuple(found)


def _meaning(model: Model, effect: Effect) -> str:
    if not model.known_effects:
        return "named by the model's own site and driver"
    known = listed(model, effect)
    if known is None:
        return "not listed among the effects known for this model"
    return f"the other way than: {known.meaning}" if against(model, effect) else known.meaning
