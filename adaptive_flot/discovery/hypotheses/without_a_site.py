"""What is told since a reference, beside what acts where the model has no site: see `further_sites.places`.

A tank with a leak and a model without one: a pump that gives less comes nearest, and would get the name. Cooling water
that is warmer than its thermometer says is told as less water. So before a part gets a name, a constant change is tried
at each balance, at what a state stores, and at each input. Where one of these explains the new records surely better
than all that would be told, the model has no place for what has changed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.further_sites.places import (
    AMOUNT,
    BALANCE,
    DRAG,
    ENDS,
    LOSS,
    further_sites,
    is_possible,
    with_further_sites,
)
from adaptive_flot.discovery.further_sites.same_meaning import is_meant, is_same_part
from adaptive_flot.discovery.further_sites.wording import as_if, change_in_words, too_many
from adaptive_flot.discovery.hypotheses.calibration import Calibration
from adaptive_flot.discovery.hypotheses.comparison import Blocks, stands, tied
from adaptive_flot.discovery.hypotheses.cross_validation import (
    Tested,
    fitted_and_tested,
)
from adaptive_flot.discovery.hypotheses.families import MATTERS, Hypothesis, constant_change
from adaptive_flot.discovery.hypotheses.joint.fit import JointFit
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.hypotheses.judgement import Judged, UsualLoss, WithoutSite
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.discovery.results.words import LARGEST_CLASS, WITH_A_NAME
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.parallel import parallel_map

LEAVES_MORE = ", and even so the errors stay above those of the reference"


def unless_without_a_site(
    calibration: Calibration,
    rows: Rows,
    blocks: Blocks,
    null: Tested,
    judged: Judged,
    usual: UsualLoss,
    base: JointFit,
    processes: int = 1,
    ends: float = float("inf"),
) -> Judged:
    """What is told since a reference; nothing where what has no site surely explains more, a class where as much.

    Parameters
    ----------
    calibration
        Constants and the model, from the reference.
    rows, blocks
        The new records, and the blocks that they are judged on.
    null
        The model as it is.
    judged
        What would be told.
    usual
        What the model costs on its reference.
    base
        Fit of the model as it is to the new records.
    processes
        Fits that run at once.
    ends
        Time of `time.monotonic` after which nothing more is fitted.
    """
    if judged.word not in WITH_A_NAME or judged.best is None:
        return judged
    model, constants = with_further_sites(calibration.model), calibration.constants

    def tested(h: Hypothesis) -> Tested | None:
        if time.monotonic() > ends:
            return None
        with np.errstate(all="ignore"):
            return fitted_and_tested(model, rows, h, constants, base)

    seen, _ = seen_values(model, base, rows.records)
    found = parallel_map(tested, _changes(model, seen), processes, lambda: None)

    def change(t: Tested) -> tuple[str, float]:
        assert t.hypothesis is not None  # each changes something at a place
        return t.hypothesis.site, t.fit.value(t.hypothesis.effect.parameter("amplitude"))

    stand = (t for t in found if t is not None and stands(rows, blocks, null, t, usual.errors))
    sites = {t.hypothesis.site for t in (judged.best, *judged.alike) if t.hypothesis is not None}
    possible = (
        t
        for t in stand
        if all(is_possible(model, record, *change(t), seen[change(t)[0]]) for record in rows.records)
        and not any(is_same_part(calibration.model, change(t)[0], site) for site in sites)
    )
    rivals = sorted(possible, key=lambda t: t.total)
    if not rivals:
        return judged

    def words(t: Tested) -> WithoutSite:
        place, amount = change(t)
        said = change_in_words(model, place, amount, "", not constants.up_to_a_factor())
        return WithoutSite(place, "constant", said)

    def alike(best: Tested, others: Sequence[Tested]) -> tuple[Tested, ...]:
        return tied(blocks, null, best, others, usual.exceeded(best, rows.count, len(blocks.edges)) is None)

    best, told = rivals[0], [judged.best, *judged.alike]
    if best.total < judged.best.total and not alike(best, told):
        near = (best, *alike(best, rivals[1:]))
        more = "" if usual.exceeded(best, rows.count, len(blocks.edges)) is None else LEAVES_MORE
        return replace(judged, word="abstain", why=as_if([words(t).words for t in near]) + more)
    said = [t.hypothesis for t in told if t.hypothesis is not None]
    is_open = len({h.site for h in said}) > 1  # what does the same as a member of a class adds nothing to it

    def adds(t: Tested) -> bool:
        place = change(t)[0]
        return not any(is_meant(model, h.effect, place, does_the_same=is_open) for h in said)

    others = [t for t in rivals if adds(t)]
    near = alike(judged.best, others)
    if near and len(judged.parts) >= LARGEST_CLASS:
        return replace(judged, word="abstain", why=too_many(len(judged.parts), words(near[0]).words))
    return replace(judged, beside=words(near[0])) if near else judged


def _changes(model: Model, seen: Mapping[str, FloatArray]) -> Sequence[Hypothesis]:
    """A constant change at each further site, its scale what the site has seen; a loss or a drag that of its balance.

    Beside a factor that hardly moves an amount says nothing of its own.
    """
    places = [s for s in further_sites(model) if not s.name.startswith(AMOUNT) or _moves(seen[s.name])]
    own = {s.name: float(np.ptp(np.quantile(seen[s.name], ENDS))) for s in places}
    sizes = ((s, own[s.name.replace(LOSS, BALANCE, 1).replace(DRAG, BALANCE, 1)]) for s in places)
    return [constant_change(site, size) for site, size in sizes if size > 0]


def _moves(value: FloatArray) -> bool:
    low, high = np.quantile(value, ENDS)
    return bool(high - low > MATTERS * abs(float(np.median(value))))
