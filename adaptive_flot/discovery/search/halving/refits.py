"""What all rungs of one refit share: the fitter, where each fit starts, and how a rung is run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

from adaptive_flot.discovery.candidates.direction import nameable
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.candidates.shapes.relays import moves_often
from adaptive_flot.discovery.candidates.shapes.step_events import refined
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.results import Alternative
from adaptive_flot.discovery.search.alternatives import fit_variant, variant_model
from adaptive_flot.discovery.search.halving.jobs import FittedJob, Job, ScoredLinearisation
from adaptive_flot.parallel import parallel_map

TIED = 0.95
"""Share of the best first-order gain from which several may tie."""


class Refit:
    """A refit of candidates on top of `before`: its rungs take it, and what the earlier ones came to."""

    def __init__(
        self,
        fitter: Fitter,
        base: Fit,
        linearisations: Sequence[ScoredLinearisation],
        before: Alternative | None,
        processes: int,
        done: Callable[[str], None],
    ) -> None:
        self.fitter, self.base, self.before, self.processes, self.done = fitter, base, before, processes, done
        self.linearisations = [
            replace(linearisation, scores=[refined(linearisation.scorer, s) for s in linearisation.scores])
            for linearisation in linearisations
        ]
        time = fitter.problem.record.time
        self.low, self.high = float(time[0]), float(time[-1])

    def run(self, jobs: list[Job], steps: int = MOST_STEPS) -> list[FittedJob]:
        """Fit these jobs, at most so many steps each; what could be fitted, best first."""

        def work(k: int) -> Fit | None:
            job = jobs[k]
            if self.fitter.problem.time_is_up:
                return None
            return fit_variant(self.fitter, self.start(job.linearisation), job.score, steps, job.warm, job.drawn)

        ended = count(1)

        def tell() -> None:
            self.done(f"{next(ended)} of {len(jobs)}: {_words(jobs)}")

        fits = parallel_map(work, range(len(jobs)), self.processes, tell)
        done = [
            FittedJob(
                job.linearisation,
                job.score,
                _alternative(self.base, self.start(job.linearisation), job.score, fit, self.before),
            )
            for job, fit in zip(jobs, fits, strict=True)
            if fit
        ]
        done = [f for f in done if moves_often(self.fitter.problem, f.alternative.fit, f.alternative.effects[-1])]
        return sorted(done, key=lambda fitted: fitted.alternative.fit.bic)

    def start(self, linearisation: int) -> Fit:
        """The fit along which a linearisation is."""
        return self.linearisations[linearisation].scorer.fit

    def keeps_up(self, a: Alternative, rival: Alternative | None, share: float) -> bool:
        """Whether an alternative gained at least a share of what a rival did, over what both stand on."""
        if rival is None:
            return True
        begun = self.before.gain if self.before else 0.0
        return a.gain - begun >= share * (rival.gain - begun)

    def tied(self) -> set[tuple[str, str]]:
        """Names that explain about as much as the best one to first order."""
        return {
            s.candidate.name
            for linearisation in self.linearisations
            for s in linearisation.scores
            if s.gain > TIED * linearisation.scores[0].gain
        }


def _words(jobs: Sequence[Job], most: int = 2) -> str:
    """Names of what a rung fits, the first few of them."""
    names = list(dict.fromkeys(" by ".join(job.score.candidate.name) for job in jobs))
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


def _alternative(base: Fit, start: Fit, score: Score, fitted: Fit, before: Alternative | None) -> Alternative:
    fit = fitted.with_model(lambda: variant_model(start, score))
    return Alternative(
        (*(before.names if before else ()), score.candidate.name),
        (*(before.known if before else ()), nameable(fit.model, fit.model.fitted_effects()[-1], score.candidate.known)),
        fit,
        base.loss - fit.loss,
        fit.bic - base.bic,
    )
