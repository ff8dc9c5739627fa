"""The stage in which a large drift of a constant, which the model does not say to drift, is no longer `none`."""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import DRIFTS
from adaptive_flot.discovery.verdict.judge import may_drift
from adaptive_flot.discovery.verdict.report_veto import FAR_FROM_NOISE
from adaptive_flot.discovery.verdict.words.wording import drift_words

NO_NAME = "Such a curve follows whatever wanders, so that it is where to look first, and no name."


def unexpected_drift(state: State) -> bool:
    """Whether a `none` rests on a drift of what is fitted, and the model does not say that it drifts."""
    if state.judged.word != "none" or state.judged.best is None:
        return False
    return not may_drift(state.refitted[0].model, state.known_problem.adapted)


def heed_large_drift(state: State) -> State:
    """Say `abstain` instead of `none` where an unexpected drift explains an error far above the noise.

    Far is FAR_FROM_NOISE, and the drift must surely help that output. A heater that fouled by 22 % was told to lack
    nothing, with the fouling in the same sentence. What wanders a little in any process stays `none`.
    """
    far = any(c.before > FAR_FROM_NOISE * c.noise and c.reduction95[0] > 0 for c in state.error)
    if not far or not unexpected_drift(state):
        return state
    drift = "; ".join(drift_words(state.judged, state.refitted[1])).replace("_", " ")
    return replace(
        state,
        judgement=replace(state.judged, word="abstain"),
        sentence=f"{DRIFTS} What explains it best: {drift}. {NO_NAME}",
    )
