"""From a click to the plant and back: a request of the page goes the way of every operator's, and is stored by name."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from sqlalchemy import select

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.requests import Inbox
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.memory import open_database
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.page_bench import ACT, Visitor, page_keys
from tests.live.processes.test_server import SPEED, free_port, together


def test_a_person_at_the_page_lowers_the_mode_and_lets_it_up_again(
    write_link: Callable[..., Link], scenario: Scenario, certificates: Path, tmp_path: Path
) -> None:
    patient = {"controller": "pi", "cycle.deadline": 0.95, "cycle.shed_after": 10}
    link = write_link(scenario, {**patient, **page_keys(tmp_path)}, port=free_port(), speed=SPEED)
    inbox = Inbox()
    page = PageServer(link, inbox)
    page.start()
    visitor = Visitor(page)

    async def run() -> None:
        async with together(link, certificates) as both:
            both.link.inbox, both.link._show = inbox, page.show
            panel = both.server.plant.panel
            await both.until(lambda: both.link.state.estimation.estimate is not None)
            assert await asyncio.to_thread(visitor.log_in, ACT, "A. Person") == 303

            async def switch(position: str, mode: Mode) -> None:
                asked = {"action": "switch", "about": position}
                assert await asyncio.to_thread(visitor.act, asked) == 202
                await both.until(lambda: both.link.state.modes.mode is mode)

            await switch("advisory", Mode.MONITOR)
            raised, _ = panel.operated(both.server.state.panel, "switch", Mode.CLOSED)
            both.server.state = type(both.server.state)(**{**vars(both.server.state), "panel": raised})
            await both.until(lambda: both.link.state.modes.mode is Mode.ADVISORY)
            await switch("closed", Mode.CLOSED)
            assert both.server.state.panel.active, "the plant has granted control, as to any operator"
            await switch("monitor", Mode.MONITOR)
            await both.until(lambda: not both.server.state.panel.active)
            begun = await asyncio.to_thread(visitor.begin)
            assert begun["now"]["switch"] == {**begun["now"]["switch"], "page": "monitor", "plant": "closed"}
            assert len(begun["rows"]) > 10

    try:
        asyncio.run(run())
    finally:
        page.close()
    engine = open_database(link.file.database, link.path.parent)
    with engine.connect() as connection:
        actions = connection.execute(select(schema.actions).order_by(schema.actions.c.cycle)).mappings().all()
        allowed = set(connection.execute(select(schema.cycles.c.allowed)).scalars())
    engine.dispose()
    assert [(a["person"], a["action"], a["about"]) for a in actions] == [
        ("A. Person", "switch", position) for position in ("advisory", "closed", "monitor")
    ]
    assert allowed == {Mode.ADVISORY, Mode.CLOSED, Mode.MONITOR}
