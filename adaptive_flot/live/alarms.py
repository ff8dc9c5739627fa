"""Alarms as control rooms know them (ISA-18.2): raised, acknowledged, cleared. Pure functions.

An alarm is on the list from when it is raised until it is both cleared and acknowledged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from adaptive_flot.contracts import Sample, Status
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.runner.scenario.scenario import Scenario

FINE = (Check.OK, Check.OLD, Check.ABSENT)
WRONG_ESTIMATES = (Status.MODEL_ERROR, Status.NOT_FINITE, Status.NOT_CONVERGED)
WRONG_DECISIONS = (Status.SHIFTED_PLAN, Status.HELD, Status.SAFE_INPUT)
LASTS = 20
"""Cycles in a row that a measurement must lie outside its limit: noise alone does not raise an alarm."""
ALL = "all"
"""About every alarm, in a request to acknowledge."""


@dataclass(frozen=True)
class Alarm:
    """One alarm.

    Attributes
    ----------
    key
        What it is about; there is one alarm of a key.
    words
        What is wrong.
    since
        Plant's time when it was raised [s]; NaN where none was known.
    active
        What is wrong still is.
    acknowledged
        Who has acknowledged it; empty for nobody.
    """

    key: str
    words: str
    since: float
    active: bool = True
    acknowledged: str = ""


Alarms = Mapping[str, Alarm]
Limits = Mapping[str, tuple[int, float, float, bool]]


def watched_limits(scenario: Scenario) -> Limits:
    """Column and range of each limited output, by name, and whether it is a share, which is told in per cent."""
    model, found = scenario.model, {}
    for name, (low, high) in ({} if scenario.limits is None else scenario.limits.outputs).items():
        j = model.index("outputs", name)
        found[name] = (j, low, high, model.outputs[j].unit == "-" and model.outputs[j].upper <= 1.0)
    return found


def conditions(outcome: Outcome, limits: Limits) -> dict[str, str]:
    """What is wrong in a cycle, in words, by key; for `limits` see `watched_limits`."""
    found: dict[str, str] = {}
    if outcome.mode is Mode.SHED:
        found["shed"] = "control was given back to the plant: turn the switch to monitor, then up again"
    for words in outcome.faults:
        found[words.split(":")[0]] = words
    for name, check in outcome.checks.items():
        if check not in FINE:
            found[f"tag {name}"] = f"{name.replace('_', ' ')}: {check.value}"
    if outcome.sample is not None:
        found |= _outside(outcome.sample, limits)
    if outcome.estimate is not None and outcome.estimate.status in WRONG_ESTIMATES:
        found["estimator"] = f"estimator: {outcome.estimate.status.value}"
    if outcome.decision is not None and outcome.decision.status in WRONG_DECISIONS:
        found["solver"] = f"solver: {outcome.decision.status.value}"
    return found


def lasting(counts: Mapping[str, int], wrong: Mapping[str, str]) -> tuple[dict[str, int], dict[str, str]]:
    """Leave out what has not lasted long enough; how many cycles in a row each limit has been left by now."""
    now = {key: counts.get(key, 0) + 1 for key in wrong if key.startswith("limit ")}
    return now, {key: words for key, words in wrong.items() if now.get(key, LASTS) >= LASTS}


def _outside(sample: Sample, limits: Limits) -> dict[str, str]:
    found = {}
    for name, (j, low, high, share) in limits.items():
        value = float(sample.outputs[j])
        if math.isfinite(value) and not low <= value <= high:
            side, end = ("below", low) if value < low else ("above", high)
            words = f"{100 * end:g} %" if share else f"{end:g}"
            found[f"limit {name}"] = f"{name.replace('_', ' ')} is {side} its limit of {words}"
    return found


def after_cycle(alarms: Alarms, wrong: Mapping[str, str], time: float) -> tuple[dict[str, Alarm], dict[str, str]]:
    """The alarms after a cycle, and words for each one that was raised or has cleared, by key."""
    now, said = dict(alarms), {}
    for key, words in wrong.items():
        known = now.get(key)
        if known is None or not known.active:
            now[key] = Alarm(key, words, time)
            said[key] = f"raised: {words}"
        elif known.words != words:
            now[key] = replace(known, words=words)
    for key, alarm in list(now.items()):
        if key in wrong or not alarm.active:
            continue
        said[key] = f"cleared: {alarm.words}"
        if alarm.acknowledged:
            del now[key]
        else:
            now[key] = replace(alarm, active=False)
    return now, said


def acknowledged(alarms: Alarms, key: str, person: str) -> tuple[dict[str, Alarm], str]:
    """The alarms after a person has acknowledged one, or all of them; what came of it, in words."""
    keys = [k for k, alarm in alarms.items() if key in (k, ALL) and not alarm.acknowledged]
    if not keys:
        return dict(alarms), "there is no such alarm to acknowledge"
    now = {k: replace(a, acknowledged=person) if k in keys else a for k, a in alarms.items()}
    return {k: a for k, a in now.items() if a.active or k not in keys}, f"acknowledged: {', '.join(keys)}"
