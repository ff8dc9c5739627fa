"""The verdict: one of six words, what stands behind it, and how it is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from adaptive_flot.discovery.assessment.detect import Detection
from adaptive_flot.discovery.assessment.verification import SURE, OutputChange, verify
from adaptive_flot.discovery.candidates.step_events import slow
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.search.alternatives import Alternative
from adaptive_flot.discovery.search.search import Search
from adaptive_flot.discovery.test_design.experiment import Experiment
from adaptive_flot.discovery.verdict.locate import Location
from adaptive_flot.greybox.effects import STATELESS_DRIVERS, Effect

Word = Literal["none", "named", "class", "unnamed", "insufficient", "abstain"]

LEAST_MARGIN = 10.0
"""Alternatives whose information criterion is worse by less are not told apart."""
MUCH = 0.1
"""Share of the error removed on fresh rows from which something is missing, though it may not be what was found."""
LARGEST_CLASS = 3
MOST_RIVALS = 5


@dataclass(frozen=True)
class NamedEffect:
    """An effect of the verdict: the fitted effect, 95 % intervals of its coefficients, and the next best names."""

    effect: Effect
    meaning: str
    interval95: Mapping[str, tuple[float, float]]
    alternatives: tuple[tuple[str, str, float, float], ...]
    """(site, driver, how much worse its criterion is, standard deviation of that)."""

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""
        return {
            **self.effect.as_dict(),
            "parameters": {k: float(v) for k, v in self.effect.coefficients.items()},
            "meaning": self.meaning,
            "interval95": {k: list(v) for k, v in self.interval95.items()},
            "alternatives": [
                {"site": s, "driver": d, "delta_bic": round(v, 1), "sd": round(sd, 1)}
                for s, d, v, sd in self.alternatives
            ],
        }


@dataclass(frozen=True)
class Verdict:
    """What a record says about what the model lacks.

    Attributes
    ----------
    word
        `none`, `named`, `class`, `unnamed`, `insufficient` or `abstain`.
    reason
        One paragraph of plain words.
    effects
        What was named, or the unnamed curve, best first.
    members
        (site, driver) of each member of a class.
    error
        Free-run error of each output on the split that chose nothing.
    report_times
        First and last time [s] of each part of the record in that split; empty when another record reported.
    tests
        Ljung-Box p values of the grade (the first output) before and after, and other tests.
    detection, location
        What the residual of the model as it is shows, and where it points; None when nothing was fitted or scored.
    parameters
        Adapted parameters in the final fit, by label.
    drift
        Change of adapted parameters with time, in words, where that explains the record.
    absorbed
        Change of each adapted parameter that the plain fit needed to mimic the effect, as a share, by label.
    notes
        What was left out or stays open.
    experiment
        Input moves that would tell the leading alternatives apart; None where there is but one.
    seconds
        Wall-clock time.
    """

    word: Word
    reason: str
    effects: tuple[NamedEffect, ...] = ()
    members: tuple[tuple[str, str], ...] = ()
    error: tuple[OutputChange, ...] = ()
    split: str = "report"
    report_times: tuple[tuple[float, float], ...] = ()
    tests: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    drift: tuple[str, ...] = ()
    absorbed: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    detection: Detection | None = None
    location: Location | None = None
    experiment: Experiment | None = None
    seconds: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the machine-readable verdict."""
        return {
            "verdict": self.word,
            "reason": self.reason,
            "effects": [e.as_dict() for e in self.effects],
            "class": [{"site": s, "driver": d} for s, d in self.members],
            "error": {
                c.output: {
                    "unit": c.unit,
                    "before": c.before,
                    "after": c.after,
                    "noise": c.noise,
                    "reduction95": list(c.reduction95),
                    "block": self.split,
                }
                for c in self.error
            },
            "report_times_s": [list(part) for part in self.report_times],
            "tests": dict(self.tests),
            "detection": self.detection.as_dict() if self.detection else [],
            "location": self.location.as_dict() if self.location else None,
            "parameters": dict(self.parameters),
            "drift": list(self.drift),
            "absorbed": dict(self.absorbed),
            "notes": list(self.notes),
            "experiment": self.experiment.as_dict() if self.experiment else None,
            "seconds": round(self.seconds, 2),
        }

    def __str__(self) -> str:
        lines = [f"verdict: {self.word}", self.reason, *(f"  {c}" for c in self.error), *self.notes]
        return "\n".join(lines + ([str(self.experiment)] if self.experiment else []))


@dataclass(frozen=True)
class Judgement:
    """What the alternatives of a search amount to, before the words."""

    word: Word
    best: Alternative | None
    members: tuple[tuple[str, str], ...]
    rivals: tuple[Alternative, ...]
    margin: float

    def near(self, a: Alternative) -> bool:
        """Whether the record does not tell an alternative from the best."""
        return self.best is not None and _near(a, self.best, self.margin)


def judge(found: Search) -> Judgement:
    """Turn the ranked alternatives into a word.

    The margin of a name is what noise can give (10 times the rows of an effective sample) or, if larger, what the best
    alternative itself still leaves unexplained: an alternative that is worse by less than the best one's
    own shortcoming is not told apart from it.
    """
    if not found.alternatives:
        return Judgement("none", None, (), (), LEAST_MARGIN)
    best = found.alternatives[0]
    if found.verification and not found.verification.confirmed:
        # smaller, but not surely or not everywhere: something else is the matter
        checked = found.verification
        sure = checked.reduction95[0] > 0 or checked.reduction > MUCH
        return Judgement("abstain" if sure else "none", best if sure else None, (), _others(found, best), LEAST_MARGIN)
    margin = _margin(found)
    close = [a for a in found.alternatives if _near(a, best, margin)]
    close = [a for a in close if not any(_only_adds_to(a, b) for b in close)]
    named = [a for a in close if all(a.known)]
    rivals = _others(found, best)
    # a drift of what is adapted is the ordinary explanation: what is hardly better does not replace it
    alike = (a for a in close if a.worse_than(best) < LEAST_MARGIN * found.rows_per_effective_sample)
    drifting = next((a for a in alike if _only_drift(a, found)), None)
    if drifting:  # all there is, unless something else had to be added to all
        return Judgement("abstain" if found.common_nuisance else "none", drifting, (), _others(found, drifting), margin)
    if not named:
        return Judgement("unnamed" if len(close) == 1 else "abstain", best, (), rivals, margin)
    if named[0] is not best and not _near(named[0], best, LEAST_MARGIN * found.rows_per_effective_sample):
        # what has no name is surely better than what has one, though neither is all there is
        return Judgement("abstain", best, (), rivals, margin)
    best, rivals = named[0], _others(found, named[0])
    names = tuple(dict.fromkeys(tuple(sorted(a.names)) for a in named))
    if len(names) == 1:
        return Judgement("named", best, (), rivals, margin)
    members = tuple(dict.fromkeys(n for group in names for n in group))
    if any(a.delta_bic > -LEAST_MARGIN for a in named):  # one that explains nothing comes close: so does the best
        return Judgement("abstain", best, (), rivals, margin)
    if len(members) <= LARGEST_CLASS * len(best.names):
        return Judgement("class", best, members, rivals, margin)
    return Judgement("abstain", best, (), rivals, margin)


def held_up(problem: Problem, found: Search, judged: Judgement) -> tuple[Search, Judgement]:
    """The judgement, confirmed for what it names: a search confirms the best alternative, which may have no name."""
    best = judged.best
    if best is None or best is found.alternatives[0] or judged.word not in ("named", "class") or not problem.whiten:
        return found, judged
    checked = verify(problem, found.base, best.fit)
    if checked.confirmed:
        return replace(found, verification=checked), judged
    return found, Judgement("abstain", found.alternatives[0], (), judged.rivals, judged.margin)


def undecided_rivals(found: Search) -> tuple[Alternative, ...]:
    """Rivals that are near the best, where some are so only for what the best leaves unexplained; else none."""
    if not found.alternatives or found.verification is None or not found.verification.confirmed:
        return ()
    best, margin = found.alternatives[0], _margin(found)
    near = tuple(a for a in found.alternatives[1:] if _near(a, best, margin))
    return near if any(not _near(a, best, LEAST_MARGIN * found.rows_per_effective_sample) for a in near) else ()


def _margin(found: Search) -> float:
    return max(LEAST_MARGIN * found.rows_per_effective_sample, found.left - found.left_threshold)


def _near(a: Alternative, best: Alternative, margin: float) -> bool:
    return a.worse_than(best) < max(margin, SURE * a.loglik_difference_sd)


def _others(found: Search, best: Alternative) -> tuple[Alternative, ...]:
    """The first few alternatives beside the best, whether they have a name or not."""
    return tuple(a for a in found.alternatives if a is not best)[:MOST_RIVALS]


def _only_adds_to(a: Alternative, b: Alternative) -> bool:
    """Whether `a` makes a constant change of `b` depend on a signal, for no gain in likelihood to speak of.

    The dependence holds the constant as a special case: no record and no test can tell it from there.
    """
    if len(a.names) != len(b.names):
        return False
    other = [(x, y) for x, y in zip(sorted(a.names), sorted(b.names), strict=True) if x != y]
    if len(other) != 1:
        return False
    (site, driver), (where, constant) = other[0]
    signal = driver not in STATELESS_DRIVERS
    return site == where and constant == "constant" and signal and b.fit.loss - a.fit.loss < LEAST_MARGIN


def _only_drift(a: Alternative, found: Search) -> bool:
    """Whether adapted parameters that change slowly are all there is; a change at an onset is an event with a cause."""
    in_time = all(site in found.adapted_sites and driver == "time" for site, driver in a.names)
    return in_time and all(slow(e, found.slow_s) for e in a.effects)
