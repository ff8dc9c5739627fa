"""What persons did at the page outlives the process: an applied extension, and a switch that was lowered."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.errors import LinkError, ModelError
from adaptive_flot.live.link import cycle as cycle_module
from adaptive_flot.live.link.replay import replay
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.program import kept
from adaptive_flot.live.requests import Action
from adaptive_flot.live.running.model_use import ModelUse
from adaptive_flot.live.running.progress import Stage
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.memory import Memory, open_database
from tests.live.bench import INITIAL
from tests.live.desk.test_desk import EFFECT, FOUND
from tests.live.desk.test_desk_changes import left, shadowed
from tests.live.desk_bench import DeskBench


def started(link: Link, folder: Path) -> DeskBench:
    """A link that begins, maybe again."""
    return DeskBench(link, memory=Memory(open_database("sqlite:///restart.sqlite", folder), link))


def applied(bench: DeskBench, monkeypatch: pytest.MonkeyPatch) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """In closed with an extended model; the parameters of the model before."""
    bench.to_closed()
    bench.finding = FOUND
    bench.run(1)

    async def run() -> None:
        shadowed(bench, monkeypatch, lambda e: e)
        bench.ask(Action.APPLY)
        await left(bench, Stage.BUILDING)

    asyncio.run(run())
    bench.finding = None
    return bench.use._before[-1].parameters


def test_an_applied_extension_is_in_use_after_a_restart_until_a_person_reverts_it(
    link: Link, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = started(link, tmp_path)
    before = applied(first, monkeypatch)
    first.run(5)
    second = started(link, tmp_path)
    third = started(link, tmp_path)  # the one before had no time for an estimate
    for bench in (second, third):
        assert bench.use.cycle.effects == (EFFECT,) and bench.use.extended
    assert third.memory is not None and "extended by bubble_size_by_air_flow (applied by A. Person)" in kept(
        link, third.memory
    ).pop(0)
    third.direct.operate("switch", Mode.CLOSED)
    progress = [third.interval() for _ in range(INITIAL)][-1]
    assert progress.outcome.estimate is not None and progress.outcome.mode is Mode.MONITOR, "not armed"
    fourth = started(link, tmp_path)
    fourth.run(3)
    assert "in use again" in fourth.ask(Action.REVERT)
    assert fourth.state.estimation.estimate is not None and fourth.use.cycle.effects == ()
    np.testing.assert_allclose(fourth.estimate.parameters, before, rtol=0.05)
    fourth.run(2)
    fifth = started(link, tmp_path)
    assert fifth.use.cycle.effects == () and not fifth.use.extended
    fifth.run(3)
    engine = open_database("sqlite:///restart.sqlite", tmp_path)
    for session in (1, 3, 4, 5):
        found = replay(engine, link, session)
        assert found.cycles > 2 and found.different == 0, (session, found.words)
    engine.dispose()


def test_an_extended_model_that_can_not_be_built_any_more_is_one_line(
    link: Link, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = started(link, tmp_path)
    applied(bench, monkeypatch)
    bench.run(2)

    def refuse(*told: object) -> None:
        raise ModelError("no such site")

    again = Memory(open_database("sqlite:///restart.sqlite", tmp_path), link)
    assert again.resumed is not None
    monkeypatch.setattr(type(link.scenario.model), "with_effects", refuse)
    with pytest.raises(LinkError, match=r"can not be built \(no such site\); correct it, or give another database"):
        ModelUse(link, again.resumed.extensions)
    assert cycle_module.Cycle(link).effects == ()


def test_a_lowered_switch_of_the_page_stays_lowered(link: Link, tmp_path: Path) -> None:
    first = started(link, tmp_path)
    first.to_closed()
    first.ask(Action.SWITCH, "monitor")
    second = started(link, tmp_path)
    assert second.memory is not None
    assert "left at monitor; without a page it does not count" in kept(link, second.memory)[-1]
    second.run(3)
    second.direct.operate("switch", Mode.CLOSED)
    assert {o.mode for o in second.run(INITIAL)} == {Mode.MONITOR}
    second.ask(Action.SWITCH, "closed")
    assert second.run(4)[-1].mode is Mode.CLOSED, "the plant's switch was seen low by the page's"
    assert started(link, tmp_path).desk.allowed is Mode.CLOSED
