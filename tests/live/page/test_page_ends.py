"""A page that ends, or shows nothing any more, is an alarm and a line on the console; the link goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.server import MOST_CYCLES
from adaptive_flot.live.program import Speaker, page_conditions
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.desk_bench import DeskBench
from tests.live.page_bench import page_keys, served, wait_for


@pytest.fixture
def paged(write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path) -> Link:
    """The short link with a page."""
    return write_link(scenario, {"controller": "pi", **page_keys(tmp_path)})


def test_a_page_that_ends_raises_an_alarm_and_the_link_goes_on(paged: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = DeskBench(paged)
    bench.to_closed()
    said: list[str] = []
    with served(paged) as (server, _):
        bench.conditions = lambda: page_conditions(server)
        speaker = Speaker(said.append)

        def cycle() -> Progress:
            progress = bench.interval()
            server.show(progress)
            speaker(progress)
            return progress

        def fail(progress: Progress) -> None:
            raise TypeError("nothing to draw")

        cycle()
        assert "page" not in bench.desk.alarms and server.problem == ""
        monkeypatch.setattr(server.hub, "publish", fail)
        cycle()
        wait_for(lambda: "can not show the cycles (TypeError: nothing to draw)" in server.problem)
        cycle()
        assert "TypeError" in bench.desk.alarms["page"].words and "TypeError" in said[-1]
        monkeypatch.undo()
        cycle()
        wait_for(lambda: server.problem == "")
        cycle()
        assert not bench.desk.alarms["page"].active and "the page runs again" in said[-1]
        server._server.should_exit = True
        wait_for(lambda: not server._thread.is_alive())
        progress = [cycle() for _ in range(MOST_CYCLES)][-1]
        assert "the page has ended" in bench.desk.alarms["page"].words
        assert [line for line in said if "the page has ended" in line] == [said[-1]], "it is said once"
        assert progress.outcome.mode is Mode.CLOSED and progress.outcome.faults == ()


def test_a_page_whose_thread_raises_says_what(paged: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(sockets: object) -> None:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr("uvicorn.Server.serve", lambda self, sockets: fail(sockets))
    with served(paged) as (server, _):
        wait_for(lambda: "OSError" in server.problem)
        assert "Too many open files" in server.problem and "the link goes on" in server.problem


def test_why_there_is_no_connection_is_said_once_and_when_there_is_one_again(paged: Link) -> None:
    """The reason may change: nothing listens at first, then the server refuses the user."""
    said: list[str] = []
    speaker, progress = Speaker(said.append), DeskBench(paged).interval()
    for why in ("", "no connection: a", "no connection: a", "no connection: b", "", ""):
        speaker(replace(progress, unreachable=why))
    about = [line.partition(": ")[2] for line in said if "connect" in line]
    assert about == ["no connection: a", "no connection: b", "connected to the plant"]
