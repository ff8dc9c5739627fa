"""Rows of the tables that a cycle fills."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from adaptive_flot.contracts import DelayedValue
from adaptive_flot.live.outcome import Outcome, Written
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store.numbers import as_column, as_text

ACTING = "acting "
ESTIMATED = ("parameters", "covariance", "state", "prediction", "innovation")
"""Arrays of an estimate that are stored."""


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


def estimate_row(outcome: Outcome, noise_std: Sequence[float]) -> dict[str, Any]:
    """Row of the table `estimates`, with the noise that the estimator counts with (m,)."""
    estimate = outcome.estimate
    assert estimate is not None
    arrays = {name: as_text(getattr(estimate, name)) for name in ESTIMATED}
    return {**arrays, "status": estimate.status.name, "noise_std": as_text(np.array(noise_std))}


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
