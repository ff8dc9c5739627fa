"""What is stored beside a cycle: what persons did, what ran in shadow, and changes of the model in use."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import RowMapping

from adaptive_flot.contracts import Decision, Estimate, Prior
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.requests import Answered
from adaptive_flot.live.store.numbers import as_array, as_column, as_text
from adaptive_flot.live.store.rows import error_columns, known_of_errors

PRIOR = ("state", "parameters", "covariance")
"""Arrays of a prior that it always has, beside those of the errors."""


@dataclass(frozen=True)
class ShadowResult:
    """What one of those that run in shadow made of a sample.

    Attributes
    ----------
    cycle
        Number of the cycle of the sample.
    role
        Its name in the link file.
    status
        In words; `ok` where nothing is wrong.
    seconds
        Time that it took [s]; NaN where it did not come to an end.
    estimate, decision
        None where there was none.
    """

    cycle: int
    role: str
    status: str
    seconds: float
    estimate: Estimate | None = None
    decision: Decision | None = None


@dataclass(frozen=True)
class ModelChange:
    """Another model from a cycle on: its effects beyond the scenario's, where its estimator starts, who wanted it."""

    effects: tuple[Effect, ...]
    prior: Prior
    person: str


@dataclass(frozen=True)
class Beside:
    """All that is stored with a cycle and does not come from it.

    Attributes
    ----------
    answered
        What persons asked for, and what came of it.
    alarms
        Words for each alarm that was raised, cleared or acknowledged, by key.
    shadows
        Results of earlier cycles that have come in.
    change
        The model that is in use from this cycle on; None where it stays.
    """

    answered: tuple[Answered, ...] = ()
    alarms: Mapping[str, str] = field(default_factory=dict)
    shadows: tuple[ShadowResult, ...] = ()
    change: ModelChange | None = None


NOTHING_BESIDE = Beside()


def action_row(number: int, answered: Answered) -> dict[str, Any]:
    """Row of the table `actions`."""
    asked = answered.request
    return {
        "number": str(number),
        "person": asked.person,
        "action": asked.action.value,
        "about": asked.about,
        "answer": answered.answer,
        "asked": asked.asked,
    }


def shadow_row(result: ShadowResult) -> dict[str, Any]:
    """Row of the table `shadows`."""
    estimate, decision = result.estimate, result.decision
    names = ("parameters", "covariance", "state", "prediction", "innovation")
    return {
        "cycle": result.cycle,
        "role": result.role,
        "status": result.status,
        "seconds": as_column(result.seconds),
        **{name: None if estimate is None else as_text(getattr(estimate, name)) for name in names},
        "inputs": None if decision is None else as_text(decision.inputs),
        "decision_status": None if decision is None else decision.status.name,
    }


def change_row(change: ModelChange) -> dict[str, Any]:
    """Row of the table `models`."""
    known = change.prior
    prior = {name: as_text(getattr(known, name)) for name in PRIOR} | error_columns(known) | {"time": repr(known.time)}
    effects = json.dumps([effect.as_dict() for effect in change.effects])
    return {"effects": effects, "prior": json.dumps(prior), "person": change.person}


def _setting(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def stored_change(row: RowMapping) -> ModelChange:
    """The change of the model in a row."""
    known = json.loads(row["prior"])
    effects = tuple(
        Effect(**{**e, "settings": {k: _setting(v) for k, v in e.get("settings", {}).items()}})
        for e in json.loads(row["effects"])
    )
    arrays: dict[str, Any] = {name: as_array(known[name]) for name in PRIOR} | known_of_errors(known)
    prior = Prior(float(known["time"]), **arrays, ongoing=True)
    return ModelChange(effects, prior, row["person"])
