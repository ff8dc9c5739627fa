"""One step at one site that alone brings a free run back to its usual errors, where process noise does not see it.

Noise of a sensor that has a memory looks like process noise, and so much of that explains nearly everything. Since a
reference whose errors are small, a free run says more: one step at one site may leave no more than the reference does,
and no step at another site comes near. Then it is told. What comes near where the model has no site is told beside it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.further_sites.places import further_sites, with_further_sites
from adaptive_flot.discovery.further_sites.same_meaning import is_same_part
from adaptive_flot.discovery.further_sites.wording import change_in_words
from adaptive_flot.discovery.hypotheses.comparison import rms
from adaptive_flot.discovery.hypotheses.cross_validation import fit_all_rows
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.joint.fit import JointFit
from adaptive_flot.discovery.hypotheses.judgement import WithoutSite
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, FAR_ABOVE
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.discovery.innovations.events.at_times import switch_at
from adaptive_flot.discovery.innovations.verdicts.event import with_hypotheses
from adaptive_flot.discovery.results.words import LARGEST_CLASS, NO_SITE, rough
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.scope import Site
from adaptive_flot.parallel import parallel_map

LEAST = 3.0
"""An error so many times its usual one, in the model as it is, asks for a step."""
EDGES, ROUNDS = 12, 4
"""Times at which a step is tried at first, and halvings of their distance about the best one."""
FOLLOWED = 4.0
"""The time of a step is looked for more closely where at first it leaves so many times the usual errors, or less."""


@dataclass(frozen=True)
class _Step:
    """A step, where it is, its fitted size, and how far above its usual error the worst output stays with it."""

    site: Site
    hypothesis: Hypothesis
    size: float
    worst: float


def with_step(compared: Comparison, processes: int, ends: float) -> Comparison:
    """The comparison with a step that is told; unchanged where none is, or the time is up.

    Parameters
    ----------
    compared
        The comparison of one new record, which tells nothing.
    processes
        Fits at once.
    ends
        The `time.monotonic` after which nothing more is looked for.
    """
    verdict = compared.verdict
    if (
        verdict.word != "abstain"
        or NO_SITE in verdict.reason
        or not any(c.before > LEAST * c.noise for c in verdict.error)
    ):
        return compared
    if any(_worst(compared, t.fresh) <= FAR_ABOVE for t in compared.tested):
        return compared  # one of the whole record comes as near
    model = with_further_sites(compared.calibration.model)
    first = fit_all_rows(model, compared.rows, None, compared.calibration.constants, None)
    if first is None:
        return compared
    tried = _tried(compared, model, first.fit, processes, ends)
    if time.monotonic() > ends:
        return compared
    places = {s.name for s in further_sites(model)}
    at_sites = [s for s in tried if s.site.name not in places]
    if not at_sites or at_sites[0].worst > ABOVE_USUAL:
        return compared
    best, own, constants = at_sites[0], compared.calibration.model, compared.calibration.constants
    alike = [s for s in tried if s.worst <= FAR_ABOVE and s.site.name != best.site.name]
    alike = [s for s in alike if not is_same_part(own, s.site.name, best.site.name)]
    words = "; or as if ".join(_in_words(compared, model, s) for s in alike if s.site.name in places)
    elsewhere = [s for s in alike if s.site.name not in places]
    if not elsewhere and len(alike) < LARGEST_CLASS:
        beside = WithoutSite(alike[0].site.name, "time", words) if alike else None
        told = with_hypotheses(compared, own, constants, (best.hypothesis,), "named", beside)
        if told is not compared:
            return told
    said = "; or ".join(_at_site(own, s) for s in (best, *elsewhere))
    also = f"; or as if {words}" if words else ""
    left = f"It leaves {rough(best.worst)} times the usual errors"
    note = f"One step in time comes near, and is not told: {said}{also}. {left}."
    return replace(compared, verdict=replace(verdict, notes=(*verdict.notes, note)))


def _at_site(model: Model, step: _Step) -> str:
    return words_of(model, step.hypothesis, lambda name: step.size)


def _in_words(compared: Comparison, model: Model, step: _Step) -> str:
    when = f"from {step.hypothesis.pulses[0][0]:.0f} s on"
    measured = not compared.calibration.constants.up_to_a_factor()
    return change_in_words(model, step.site.name, step.size, when, measured)


def _tried(compared: Comparison, model: Model, first: JointFit, processes: int, ends: float) -> list[_Step]:
    """The best step of each site and place, the best first."""
    record = compared.rows.records[0]
    begin, end = float(record.time[0]), float(record.time[-1])
    apart = (end - begin) / (EDGES + 1)
    coarse = [begin + apart * (k + 1) for k in range(EDGES)]

    def at(site: Site, onset: float) -> _Step | None:
        if time.monotonic() > ends:
            return None
        h = switch_at(site, site.mode, [(onset, FOREVER)], record.dt)
        fitted = fit_all_rows(model, compared.rows, h, compared.calibration.constants, first)
        if fitted is None:
            return None
        return _Step(site, h, fitted.fit.value(h.parameters[0]), _worst(compared, fitted.fit.errors))

    def best_of(site: Site, onsets: list[float]) -> _Step | None:
        found = [s for s in (at(site, onset) for onset in onsets) if s is not None]
        return min(found, key=lambda s: s.worst, default=None)

    def closer(step: _Step) -> _Step:
        far = apart
        for _ in range(ROUNDS):
            far /= 2
            onset = step.hypothesis.pulses[0][0]
            near = best_of(step.site, [onset - far, onset + far])
            step = near if near is not None and near.worst < step.worst else step
        return step

    steps = [s for s in parallel_map(lambda site: best_of(site, coarse), model.sites, processes) if s is not None]
    followed = [s for s in steps if s.worst <= FOLLOWED]
    return sorted(parallel_map(closer, followed, processes), key=lambda s: s.worst)


def _worst(compared: Comparison, errors: Sequence[FloatArray]) -> float:
    """Largest error of an output over its usual one; infinite where one has none."""
    sizes = rms(compared.rows, errors) / compared.calibration.usual.rms
    return float(np.max(np.where(np.isfinite(sizes), sizes, np.inf)))
