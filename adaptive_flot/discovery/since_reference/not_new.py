"""What is no change since a reference: it is on the reference as well, or so small that what wanders may be it."""

from __future__ import annotations

import numpy as np

from adaptive_flot.discovery.hypotheses.calibration import criterion
from adaptive_flot.discovery.hypotheses.comparison import LEAST_DIFFERENCE
from adaptive_flot.discovery.hypotheses.cross_validation import fit_all_rows, model_with, with_effect_states
from adaptive_flot.discovery.hypotheses.families import EVENTS
from adaptive_flot.discovery.hypotheses.joint.fit import JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import loose_constants
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL, FAR_ABOVE
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.discovery.since_reference.searched_change import AT_NOISE, SEARCHED

EXPLAINS = 0.7
"""A fault explains the reference where it leaves at most so much of its criterion: another one takes a few per cent."""
NEARLY_ALL = 0.9
"""Share of what is above the usual errors that a name takes which needs no more."""
FAR_OFF = 10.0
"""Errors on the reference of so many times the noise from row to row: the model lacks much there already."""
OTHERWISE = 4.0
"""Such a model errs by up to so many times as much where a record has other inputs, and nothing has changed."""
AS_LARGE = 0.5
"""A fault is the same on the reference where it is at least so many times as large there, and goes the same way."""


def why_not_new(compared: Comparison, confirmed: bool) -> str:
    """Why what is named or in a class is no change; empty where it may be one.

    Parameters
    ----------
    compared
        The comparison with a reference.
    confirmed
        Whether the innovations form has been asked whether it knows the name.
    """
    verdict = compared.verdict
    if verdict.word not in WITH_A_NAME:
        return ""
    if _is_there_before(compared):
        return "it explains the reference as well, so that the model lacks it there too"
    if _explains_all_records_better(compared):
        return "on all records it explains more than since the reference alone, so that nothing says that it is new"
    calibration = compared.calibration
    wanders = bool((calibration.usual.overall > AT_NOISE * calibration.noise).any())
    little = all(c.before <= FAR_ABOVE * c.noise for c in verdict.error)
    if wanders and not confirmed and little and not compared.judged.explained >= NEARLY_ALL:
        return (
            "errors are not far above those of the reference, which are more than noise, and it does not explain "
            "nearly all of that: what wanders may do that"
        )
    most = max((c.before / c.noise for c in verdict.error if c.noise > 0), default=0.0)
    remains = any(c.after > ABOVE_USUAL * c.noise for c in verdict.error)
    if (calibration.usual.overall > FAR_OFF * calibration.noise).all() and remains and most <= OTHERWISE:
        return (
            "the model is far off on the reference already, and with this it still errs by more than there: with other "
            "inputs it may do that, though nothing has changed"
        )
    return ""


def _is_there_before(compared: Comparison) -> bool:
    """Whether the best hypothesis explains the reference, too, and about as large: a plant has it on all records.

    The constants of the reference hide most of what the model lacks there, and other inputs bring it to light.
    """
    best, calibration = compared.judged.best, compared.calibration
    h = best.hypothesis if best is not None else None
    if best is None or h is None or h.kind in (*EVENTS, SEARCHED) or not h.free:
        return False
    base = fit_all_rows(calibration.model, calibration.rows, None, calibration.constants, None)
    if base is None:
        return False
    there = fit_all_rows(calibration.model, calibration.rows, h, calibration.constants, base.fit)
    if there is None or there.fit.cost > EXPLAINS * base.fit.cost:
        return False
    sizes = ((there.fit.value(n), best.fit.value(n)) for n in h.parameters)
    return all(before * now > 0 and abs(before) >= AS_LARGE * abs(now) for before, now in sizes)


def _explains_all_records_better(compared: Comparison) -> bool:
    """Whether the best hypothesis on the reference as well, with constants that fit it, is better than since it alone.

    A law of the model that is a little wrong shows where a record runs at other conditions. Constants of the reference
    hide it there, and a fault of the new record alone makes up for it here. With the criteria C of reference (r) and
    new record (n), the hypothesis h, and the distance d of constants from what the reference says::

        C_rn(h on both) < C_r(without) + C_n(h) + d^2 - LEAST_DIFFERENCE

    A change that is new makes the reference worse. One that the reference could not show is the same on both sides.
    """
    best, calibration = compared.judged.best, compared.calibration
    h = best.hypothesis if best is not None else None
    if best is None or h is None or h.kind in (*EVENTS, SEARCHED) or not h.free:
        return False
    both = compared.rows.behind(calibration.rows)
    extended = model_with(calibration.model, h)
    before = with_effect_states(extended, calibration.fit.initial, calibration.rows.records)
    constants = loose_constants(calibration.model, calibration.constants.names)
    fitter = JointFitter(extended, both, constants, h.parameters, [*before, *best.fit.initial])
    with np.errstate(all="ignore"):
        fit = fitter.fit_from_afar(fitter.unknowns.start({n: best.fit.value(n) for n in h.parameters}))
    now = criterion(calibration.rows, calibration.fit) + criterion(compared.rows, best.fit)
    return criterion(both, fit) < now + best.moved(len(calibration.constants.names)) - LEAST_DIFFERENCE
