"""What begins at a place where the model has no site, since a reference, where nothing is told at a site.

A vessel that leaks shows in its balance, and a model without a site there has no part to name. What comes nearest at a
site says little then. So a change is tried at each further place, at times of its own. It is said beside `abstain`, and
no name: other causes without a site may do the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.further_sites.places import further_sites, is_possible, with_further_sites
from adaptive_flot.discovery.further_sites.wording import as_if
from adaptive_flot.discovery.hypotheses.comparison import rms
from adaptive_flot.discovery.hypotheses.cross_validation import fit_all_rows, fitted_and_tested
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, FAR_ABOVE
from adaptive_flot.discovery.innovations.places.row_by_row import best_of_each, change_at, words_at
from adaptive_flot.discovery.innovations.search.explanation import Explanation, worth
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.rivals import explains_too_little
from adaptive_flot.discovery.results.words import NO_SITE, WITH_A_NAME
from adaptive_flot.discovery.since_reference.taken_back import taken_back

REFITTED = 12
"""Changes at further places that are refitted, the best by a regression."""
MOST_PULSES = 3
"""Times that a change is there at most, here or at a site: one that comes and goes more often draws what is left."""


def with_what_is_nearest(
    compared: Comparison, search: Search, base: Explanation, found: Sequence[Explanation]
) -> Comparison:
    """The comparison; where nothing is told at a site, with what may have begun where the model has none.

    Parameters
    ----------
    compared
        The comparison of the whole record.
    search, base
        The search in innovations form, and the model as it is.
    found
        Explanations at sites that a change at a place must be worth more than.
    """
    verdict = compared.verdict
    far = any(c.before > FAR_ABOVE * c.noise for c in verdict.error)
    if verdict.word != "abstain" or not far or NO_SITE in verdict.reason or search.time_is_up:
        return compared
    words = nearest_without_a_site(compared, search, base, found)
    if not words or search.time_is_up:  # what is cut short would say another place on another machine
        return compared
    reason = f"Something differs from the reference. It is not told what, but it is {as_if(words)}."
    said = f"By single faults of the whole record: {verdict.reason}"
    return replace(compared, verdict=replace(verdict, reason=reason, notes=(*verdict.notes, said)))


def with_words_without_a_site(compared: Comparison, vetoed: Told, why: str) -> Comparison:
    """The comparison with what acts where no site is: a note where another part is told, else first.

    What free runs tell at a site of what is `vetoed` with process noise is taken back.
    """
    verdict = compared.verdict
    elsewhere = verdict.sites - {h.site for h in vetoed.effects}
    if elsewhere or verdict.word not in ("abstain", *WITH_A_NAME):
        return replace(compared, verdict=replace(verdict, notes=(*verdict.notes, f"With process noise it is {why}.")))
    alone = f"By single faults of the whole record: {verdict.reason}"
    compared = taken_back(compared, why)
    reason = f"Something differs from the reference, {why}."
    return replace(compared, verdict=replace(compared.verdict, reason=reason, notes=(*verdict.notes, alone)))


def nearest_without_a_site(
    compared: Comparison, search: Search, base: Explanation, found: Sequence[Explanation]
) -> list[str]:
    """In words what may act at places without a site, the best first; empty where a site explains more.

    A change there must be worth more than those that were found at sites. It must explain free runs as well: of each
    output that is above what is usual on the reference, half of what its squared error is above that.

    Parameters
    ----------
    compared
        The comparison of the whole record, which tells nothing.
    search, base
        The search in innovations form, and the model as it is.
    found
        Explanations at sites.
    """
    further = replace(search, model=with_further_sites(search.model))
    places = further_sites(further.model)
    screening = further.screening(base, [s.name for s in places])
    changes = [c for s in places for c in (screening.switch(s), screening.ramp(s), *screening.constant(s))]
    few = [c for c in changes if c is not None and _is_there_few_times(c.suspect.hypothesis)]
    changed = further.all_with(base, sorted(few, key=lambda c: -c.gain)[:REFITTED])
    moved = ((e, *change_at(further, e)) for e in changed)
    possible = (e for e, at, by in moved if is_possible(search.model, search.record, at, by, screening.seen(at)))
    rivals = best_of_each(sorted(possible, key=lambda e: -worth(e)))
    at_sites = (worth(e) for e in found if all(map(_is_there_few_times, e.hypotheses)))
    if (
        not rivals
        or worth(rivals[0]) <= max(at_sites, default=worth(base))
        or not _explains(compared, further, rivals[0])
    ):
        return []
    near = [e for e in rivals[1:] if not told_apart(further, base, rivals[0], e)]
    # with process noise a constant amount may do as well as a stiffness, and explain nothing of a free run
    return [words_at(further, e) for e in (rivals[0], *(e for e in near if _explains(compared, further, e)))]


def _is_there_few_times(h: Hypothesis) -> bool:
    return len(h.pulses) <= MOST_PULSES


def _explains(compared: Comparison, further: Search, explanation: Explanation) -> bool:
    """Whether free runs get better by a change at a place, on stretches that did not fit it."""
    rows, constants = compared.rows, further.known or compared.calibration.constants
    model, usual = further.model, compared.calibration.usual.rms
    first = fit_all_rows(model, rows, None, constants, None)
    assert first is not None  # the model as it is can be simulated
    hypothesis = further.started(explanation, explanation.hypotheses[-1])
    tested = fitted_and_tested(model, rows, hypothesis, constants, first.fit)
    if tested is None:
        return False
    before, after = rms(rows, first.fit.errors), rms(rows, tested.fresh)
    errors = zip(before, np.nan_to_num(after, nan=np.inf), usual, strict=True)
    return not any(explains_too_little(b, a, s, ABOVE_USUAL) for b, a, s in errors)
