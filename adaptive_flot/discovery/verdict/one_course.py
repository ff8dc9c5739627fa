"""Several changes with one course in time are one cause that acts at several places: no name of a part is told.

A cell that cools changes the size of the bubbles, the flow of the concentrate and more, all at once and in proportion.
A search that knows causes at one place each finds two or three of them. Each fits, and none is what has happened.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import casadi as ca
import numpy as np

from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import ONE_CAUSE, TELLING
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray

SAME_COURSE = 0.97
"""Correlation of two changes over the record, up to the sign, from which they have one course."""
TURNS = 0.1
"""Least share of a change that no straight line draws: two lines have one course whatever is behind them."""


def heed_one_course(state: State) -> State:
    """Tell no name where two changes at different sites have one course, and say that they have.

    ::

        |corr(g_1(t_k), g_2(t_k))| > SAME_COURSE

    over the rows t_k, with the fitted changes g of the two. Two causes that have nothing to do with one another turn
    at different times. A change that is nearly a straight line turns nowhere, and says nothing of this.
    """
    judged = state.judged
    if judged.best is None or judged.word not in TELLING:
        return state
    time, told = state.searched[0].record.time, judged.part or judged.best.names
    wanted = (e for e, name in zip(judged.best.effects, judged.best.names, strict=True) if name in told)
    changes = [(e, _change(e, time)) for e in wanted if e.driver == "time" and e.family.static]
    turning = [(e, x) for e, x in changes if _turns(time, x)]
    for (a, x), (b, y) in combinations(turning, 2):
        together = float(np.corrcoef(x, y)[0, 1])
        if a.site != b.site and abs(together) > SAME_COURSE:
            why = (
                f"{spaced(a.site)} and {spaced(b.site)} change with one course in time (correlation {together:.2f}). "
                f"{ONE_CAUSE}"
            )
            unnamed = replace(judged, word="abstain", members=(), part=())
            return replace(state, judgement=unnamed, contradiction=why, likelihood=0.0)
    return state


def _turns(time: FloatArray, change: FloatArray) -> bool:
    """Whether a change (N,) turns within the record: a share TURNS of its standard deviation is beside any line."""
    moved = float(np.std(change))
    beside = change - np.polynomial.Polynomial.fit(time, change, 1)(time)
    return moved > 0 and float(np.std(beside)) > TURNS * moved


def _change(effect: Effect, time: FloatArray) -> FloatArray:
    """What a fitted effect does at the rows (N,) of a record."""
    t = ca.SX.sym("t")
    coefficients: dict[str, ca.SX] = {name: ca.SX(value) for name, value in effect.coefficients.items()}
    assert effect.family.static is not None  # all others have been left out
    law = ca.Function("change", [t], [ca.SX(effect.family.static(t, coefficients, effect.full_settings))])
    change: FloatArray = np.array(law(time[None, :]), dtype=float).ravel()
    return change
