"""What persons ask for: the page never goes past the plant's switch, and no model is applied without a person."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import select

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.replay import replay
from adaptive_flot.live.link_file import TRIED, Link
from adaptive_flot.live.requests import Action, Inbox, Request
from adaptive_flot.live.running.desk import FEWEST_ROWS, ITSELF
from adaptive_flot.live.running.progress import Stage
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.desk_bench import DeskBench

EFFECT = Effect("bubble_size", "air_flow", "linear", {"slope": 0.2}, {"reference": 1.5e-3})
FOUND = Finding("named", "bubbles grow with air", ("a test",), (("concentrate_grade", "-", 2e-3, 1e-3),), (EFFECT,))


@pytest.fixture(scope="module")
def plain(link: Link) -> DeskBench:
    """A bench in closed, which each test leaves there."""
    bench = DeskBench(link)
    bench.to_closed()
    return bench


def test_the_page_lowers_and_raises_within_what_the_plant_allows(plain: DeskBench) -> None:
    assert "advisory" in plain.ask(Action.SWITCH, "advisory")
    assert plain.state.modes.mode is Mode.ADVISORY
    plain.direct.operate("switch", Mode.MONITOR)
    plain.ask(Action.SWITCH, "closed")
    assert {o.mode for o in plain.run(3)} == {Mode.MONITOR}, "the plant's switch counts"
    plain.direct.operate("switch", Mode.CLOSED)
    assert plain.run(4)[-1].mode is Mode.CLOSED


def test_after_shedding_the_switch_of_the_page_goes_down_and_up_like_the_operators(plain: DeskBench) -> None:
    plain.direct.operate("switch", Mode.ADVISORY)  # at the plant: it takes control back
    plain.direct.operate("switch", Mode.CLOSED)
    assert plain.run(2)[-1].mode is Mode.SHED
    plain.ask(Action.SWITCH, "closed")
    assert {o.mode for o in plain.run(3)} == {Mode.SHED}, "up alone is not enough"
    plain.ask(Action.SWITCH, "monitor")
    plain.ask(Action.SWITCH, "closed")
    assert plain.run(4)[-1].mode is Mode.CLOSED


def test_a_switch_of_the_page_holds_while_the_plants_can_not_be_read(plain: DeskBench) -> None:
    plain.ask(Action.SWITCH, "monitor")
    told = plain.direct.snapshot()
    unread = type(told)(**{**vars(told), "switch": None})
    for allowed in (Mode.OFF, Mode.MONITOR, Mode.ADVISORY, Mode.CLOSED):
        page = type(told)(**{**vars(unread), "allowed": allowed})
        for mode in Mode:
            lowers = allowed < min(mode, Mode.CLOSED)
            assert page.permitted(mode) is (allowed if lowers else None), "only the plant says how far up it may go"
    plain.ask(Action.SWITCH, "closed")
    assert plain.run(4)[-1].mode is Mode.CLOSED


@pytest.mark.parametrize(
    ("action", "about"),
    [
        (Action.SWITCH, "shed"),
        (Action.SWITCH, ""),
        (Action.ACKNOWLEDGE, "nothing"),
        (Action.SHADOW, ""),
        (Action.APPLY, ""),
        (Action.REVERT, ""),
    ],
)
def test_what_can_not_be_done_changes_nothing(plain: DeskBench, action: Action, about: str) -> None:
    before = plain.desk.allowed, plain.desk.card, plain.use.cycle, dict(plain.desk.alarms)
    words = plain.ask(action, about)
    assert any(said in words for said in ("no ", "nothing"))
    assert before == (plain.desk.allowed, plain.desk.card, plain.use.cycle, dict(plain.desk.alarms))
    assert plain.state.modes.mode is Mode.CLOSED


def test_the_inbox_takes_no_more_than_it_holds() -> None:
    inbox = Inbox()
    asked = Request("A", Action.ACKNOWLEDGE, "all")
    taken = [inbox.put(asked) for _ in range(100)]
    assert sum(taken) == len(inbox.take()) < 100 and inbox.take() == []


async def pause(bench: DeskBench) -> None:
    """Long while a shadow or a model is being built, from which intervals would only take the processor."""
    card, shadow = bench.desk.card, bench.desk.shadows().get(TRIED)
    builds = (shadow is not None and shadow.newest is None) or (card is not None and card.stage is Stage.BUILDING)
    await asyncio.sleep(0.2 if builds else 0.01)


async def tried(bench: DeskBench, rows: int = FEWEST_ROWS) -> None:
    """Intervals until the extended model has run so long in shadow."""
    limit = time.monotonic() + 120
    while bench.desk.shadows()[TRIED].compared.rows < rows:
        bench.interval()
        await pause(bench)
        assert time.monotonic() < limit, bench.desk.shadows()[TRIED]


async def went(bench: DeskBench, stage: Stage) -> None:
    limit = time.monotonic() + 120
    while bench.desk.card is None or bench.desk.card.stage is not stage:
        bench.interval()
        await pause(bench)
        assert time.monotonic() < limit, bench.desk.card


def test_a_person_tries_applies_and_reverts_an_extension_and_all_of_it_replays(link: Link, tmp_path: Path) -> None:
    engine = open_database("sqlite:///desk.sqlite", tmp_path)
    bench = DeskBench(link, memory=Memory(engine, link))

    async def run() -> None:
        bench.to_closed()
        bench.finding = FOUND
        bench.run(3)
        assert "discovery" in bench.desk.alarms
        assert bench.desk.card is not None and bench.desk.card.stage is Stage.FOUND, "nobody has asked for anything"
        assert "shadow first" in bench.ask(Action.APPLY)
        bench.ask(Action.SHADOW)
        assert "rows in shadow" in bench.ask(Action.APPLY)
        await tried(bench)
        base = bench.use.cycle
        bench.ask(Action.APPLY, person="B. Other")
        await went(bench, Stage.APPLIED)
        card = bench.desk.card
        assert card is not None
        assert (card.by, bool(card.errors)) == ("B. Other", True)
        assert [e.label for e in bench.use.cycle.effects] == ["bubble_size_by_air_flow"]
        assert TRIED not in bench.desk.shadows()
        applied = bench.run(3)
        assert applied[-1].mode is Mode.CLOSED, "the hand-over between models is no reason to shed"
        bench.ask(Action.REVERT)
        bench.run(3)
        assert bench.use.cycle is base
        await went(bench, Stage.REVERTED)

    try:
        asyncio.run(run())
    finally:
        bench.desk.close()
    with engine.connect() as connection:
        actions = connection.execute(select(schema.actions).order_by(schema.actions.c.cycle)).mappings().all()
        rows = connection.execute(select(schema.shadows)).mappings().all()
    assert [(a["person"], a["action"]) for a in actions] == [
        ("A. Person", "apply"),
        ("A. Person", "shadow"),
        ("A. Person", "apply"),
        ("B. Other", "apply"),
        ("A. Person", "revert"),
    ]
    assert {row["role"] for row in rows} == {TRIED} and len(rows) > FEWEST_ROWS
    found = replay(engine, link)
    assert found.different == 0 and found.estimates > FEWEST_ROWS, found.words
    engine.dispose()


@pytest.mark.parametrize(
    ("extend", "slope", "stage"),
    [("by a person", 0.0, Stage.FOUND), ("by itself", 0.0, Stage.APPLIED), ("by itself", 1.5, Stage.SHADOW)],
)
def test_the_link_applies_by_itself_only_what_its_file_lets_it_and_what_predicts_no_worse(
    write_link: Callable[..., Link],
    write_live_scenario: Callable[..., Scenario],
    extend: str,
    slope: float,
    stage: Stage,
) -> None:
    delay = 30
    scenario = write_live_scenario({"discovery": {"delay_s": delay}})
    bench = DeskBench(write_link(scenario, {"controller": "pi", "extend": extend}))

    async def run() -> None:
        bench.to_closed()
        bench.finding = replace(FOUND, effects=(replace(EFFECT, coefficients={"slope": slope}),))
        if stage is Stage.FOUND:
            bench.run(2 * delay)
        elif stage is Stage.SHADOW:
            bench.run(3)
            await tried(bench, 2 * delay)
        else:
            await went(bench, stage)

    try:
        asyncio.run(run())
        card = bench.desk.card
        assert card is not None and card.stage is stage
        if stage is Stage.APPLIED:
            assert card.by == ITSELF and all(after <= 1.02 * before for _, before, after in card.errors)
    finally:
        bench.desk.close()
