"""Sensors that are read at intervals: one that is late may be, and so may one that moves at even times only."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.candidates.responses import Responses
from adaptive_flot.discovery.candidates.shapes.readings import held_score
from adaptive_flot.discovery.fitting.descent import nodes_for
from adaptive_flot.discovery.fitting.fit import Fit, parameters_of
from adaptive_flot.discovery.search.halving.first_rungs import NEAR_FINALIST
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, best_of_each, near
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.greybox.effects import LATE
from adaptive_flot.greybox.stepping.record import RecordSimulator


def held(refit: Refit, last: list[FittedJob]) -> list[FittedJob]:
    """Sensors as ones that are read at even intervals: those near the best that are late, and those that look so."""
    late: dict[str, FittedJob] = {}
    for fitted in best_of_each(near(last, share=NEAR_FINALIST)):
        if fitted.alternative.effects[-1].driver in LATE and fitted.score.candidate.site.role == "sensor":
            late.setdefault(fitted.alternative.effects[-1].site, fitted)
    for fitted in _moved_evenly(refit, set(late)):
        late.setdefault(fitted.alternative.effects[-1].site, fitted)
    return refit.run([job for fitted in late.values() for job in _held(refit, fitted)])


def _moved_evenly(refit: Refit, known: set[str]) -> list[FittedJob]:
    """Sensors beside the known ones whose output moves at even times only, each with a dead time.

    A dead time explains their steps badly, and may be far from the best.
    """
    evenly = refit.fitter.problem.evenly_moved
    if not evenly:
        return []
    scorer = refit.linearisations[0].scorer
    jobs = []
    for score in scorer.scores():
        site, driver = score.candidate.name
        if driver == "delay" and score.candidate.site.role == "sensor" and site not in known:
            output = scorer.output_of(site)
            if output is not None and output[0] in evenly:
                jobs.append(Job(0, score))
    return refit.run(jobs)


def _held(refit: Refit, fitted: FittedJob) -> list[Job]:
    scorer = refit.linearisations[fitted.linearisation].scorer
    name = fitted.alternative.effects[-1].site, "delay"
    score = next((s for s in scorer.scores() if s.candidate.name == name), None)
    if score is None:
        return []
    plain = _prompt(refit, fitted.alternative.fit)
    found = held_score(Responses(refit.fitter.problem, plain), plain, score)
    return [Job(fitted.linearisation, found, fitted.alternative.fit, drawn=True)] if found else []


def _prompt(refit: Refit, fit: Fit) -> Fit:
    """A fit whose last effect, which is late, does nothing, with what it predicts then."""
    problem, effect = refit.fitter.problem, fit.model.fitted_effects()[-1]
    simulator = RecordSimulator(fit.model, problem.record.dt, nodes_for(problem, fit.model))

    def run(of: Fit) -> Fit:
        outputs = simulator.outputs(problem.record, of.initial_state, parameters_of(of))
        return replace(of, predicted=outputs[:, problem.columns])

    plain = run(replace(fit, model=fit.model.with_parameters({effect.parameter("amplitude"): 0.0})))
    return replace(plain, predicted=fit.predicted + plain.predicted - run(fit).predicted)
