"""The benchmark's auditor: a sound link makes no unsafe write under faults, and a careless one is caught."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from adaptive_flot.live.link import cycle as cycle_module
from adaptive_flot.live.link import samples
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.safety import modes
from adaptive_flot.live.safety.checks import Check
from benchmarks.live import faults
from benchmarks.live.lockstep import Found, Lockstep


def run(link: Link, folder: Path, monkeypatch: pytest.MonkeyPatch, cycles: int = 400) -> Found:
    monkeypatch.setattr(faults, "TAG_RATE", 0.01)
    monkeypatch.setattr(faults, "EVENT_RATE", 0.03)
    return Lockstep(link, folder, seed=3).run(cycles)


def test_a_sound_link_under_faults(link: Link, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = run(link, tmp_path, monkeypatch)
    assert found.audit.unsafe == {}
    assert found.audit.writes > 50 and found.sessions > 1 and len(found.counted) >= 11
    assert (found.rows.lost, found.rows.doubled) == (0, 0)
    assert max(found.audit.shed_cycles) <= 3 and found.audit.bump <= 1 + 1e-6


def believes_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "USABLE", tuple(Check))


def never_sheds(monkeypatch: pytest.MonkeyPatch) -> None:
    def careless(rules: modes.ModeRules, state: modes.ModeState, facts: modes.CycleFacts) -> modes.Step:
        blind = replace(facts, alive=True, measured=True, in_time=True, written=True)
        return modes.step(rules, state, blind)

    monkeypatch.setattr(cycle_module, "step", careless)


@pytest.mark.parametrize(("sabotage", "reason"), [(believes_everything, "from a "), (never_sheds, "in a bad cycle")])
def test_a_careless_link_is_caught(
    link: Link,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    sabotage: Callable[[pytest.MonkeyPatch], None],
    reason: str,
) -> None:
    sabotage(monkeypatch)
    found = run(link, tmp_path, monkeypatch, cycles=400)
    assert any(words.startswith(reason) for words in found.audit.unsafe)
