"""Rows of the tables that a cycle fills."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adaptive_flot.contracts import DelayedValue, Estimate, Prior
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.outcome import Outcome, Written
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store.numbers import as_array, as_column, as_text

ACTING = "acting "
ESTIMATED = ("parameters", "covariance", "state", "prediction", "innovation")
"""Arrays of an estimate that are stored."""
OF_ERRORS = ("noise_std", "colour", "core_noise_std")
"""Arrays of a prior about the errors of the measurements, each (m,)."""


def cycle_row(snapshot: Snapshot, outcome: Outcome) -> dict[str, Any]:
    """Row of the table `cycles`."""
    return {
        "plant_time": as_column(snapshot.time),
        "record_time": None if outcome.sample is None else outcome.sample.time,
        "alive": snapshot.alive,
        "switch": None if snapshot.switch is None else int(snapshot.switch),
        "allowed": int(snapshot.allowed),
        "granted": snapshot.granted,
        "in_time": snapshot.in_time,
        "written": snapshot.written,
        "mode": outcome.mode.name.lower(),
        "asks_control": outcome.asks_control,
        "faults": "; ".join(outcome.faults),
    }


def tag_rows(snapshot: Snapshot, outcome: Outcome) -> list[dict[str, Any]]:
    """Rows of the table `tags`, one each."""
    acting = {f"{ACTING}{name}": tag for name, tag in snapshot.acting.items()}
    return [
        {
            "tag": name,
            "value": as_column(tag.value),
            "quality": tag.quality.value,
            "source_time": as_column(tag.source_time),
            "result": outcome.checks.get(name, Check.ABSENT).name.lower() if name in snapshot.tags else "",
        }
        for name, tag in {**snapshot.tags, **acting}.items()
    ]


def sample_row(outcome: Outcome) -> dict[str, Any]:
    """Row of the table `samples`."""
    assert outcome.sample is not None
    late: list[DelayedValue] = list(outcome.sample.delayed)
    return {
        "inputs": as_text(outcome.sample.inputs),
        "outputs": as_text(outcome.sample.outputs),
        "delayed": "; ".join(f"{v.output} {v.time!r} {v.value!r}" for v in late),
    }


def estimate_row(estimate: Estimate, began: Prior) -> dict[str, Any]:
    """Row of the table `estimates`, with what is known of the errors since the estimator was started."""
    arrays = {name: as_text(getattr(estimate, name)) for name in ESTIMATED}
    return {**arrays, **error_columns(began), "status": estimate.status.name}


def error_columns(prior: Prior) -> dict[str, str | None]:
    """What a prior knows of the errors of the measurements, by column; None where it is not known."""
    known = {name: getattr(prior, name) for name in OF_ERRORS}
    return {name: None if value is None else as_text(value) for name, value in known.items()}


def known_of_errors(row: Mapping[Any, Any]) -> dict[str, FloatArray]:
    """The same back from a row."""
    return {name: as_array(text) for name in OF_ERRORS if (text := row[name]) is not None}


def decision_row(outcome: Outcome) -> dict[str, Any]:
    """Row of the table `decisions`."""
    decision = outcome.decision
    assert decision is not None
    return {
        "inputs": as_text(decision.inputs),
        "status": decision.status.name,
        "decided_by": decision.decided_by,
        "message": decision.message,
    }


def result_row(name: str, written: Written) -> dict[str, Any]:
    """Row of the table `write_results`."""
    back = as_column(written.read_back)
    return {"input": name, "value": written.value, "read_back": back, "problem": written.problem}
