"""What happened at one step of an estimator or a controller."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """What happened at one step. Numbers fail as values: none of these is an exception."""

    OK = "ok"
    MISSING = "measurement missing: predicted only"
    DELAYED = "delayed value put in its place, the samples since then taken again"
    TOO_OLD = "delayed value without a sample of its time among those kept: not used"
    PROJECTED = "estimate projected onto its bounds"
    LOW_INFORMATION = "the data say too little about some direction: the estimate is held along it"
    MODEL_ERROR = "the parameters take up something else: the model lacks an effect, or a constant is wrong"
    NOT_FINITE = "prediction not finite: sample skipped, last estimate kept"
    NOT_CONVERGED = "search stopped before it converged: best values so far"
    RETRIED = "solved at the second try, from a cold start"
    SOFTENED = "no plan keeps every limit: some were given up in the stated order"
    SHIFTED_PLAN = "no valid solution: the plan of the step before goes on"
    HELD = "no valid solution and no plan: the inputs are held"
    SAFE_INPUT = "nothing else was valid: the safe inputs"
    INITIALISING = "collecting the record for the initial estimate"
