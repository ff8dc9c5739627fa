"""A person can always go back to the model before, and an extension that can not be taken up changes nothing."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import TRIED, Link
from adaptive_flot.live.page.picture import Pictures
from adaptive_flot.live.requests import Action
from adaptive_flot.live.running.desk import FEWEST_ROWS
from adaptive_flot.live.running.progress import Progress, Stage
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.shadow.comparison import Compared
from adaptive_flot.live.shadow.process import Shadow, ShadowView
from adaptive_flot.live.shadow.worker import ShadowPlan
from adaptive_flot.live.store.beside import ShadowResult
from tests.live.desk.test_desk import FOUND
from tests.live.desk_bench import DeskBench

LATER = Finding("abstained", "nothing explains what is left")


class Tried:
    """A shadow that has run long enough, without a process."""

    def __init__(self, estimate: Estimate, status: str = "ok") -> None:
        self.estimate, self.status = estimate, status

    def feed(self, *told: Any) -> None:
        """Take a sample."""

    def collect(self) -> list[ShadowResult]:
        """No results."""
        return []

    def close(self) -> None:
        """Nothing to end."""

    def view(self) -> ShadowView:
        """What the link sees."""
        newest = ShadowResult(1, TRIED, self.status, 0.0, self.estimate)
        return ShadowView(ShadowPlan(TRIED, "rpem"), self.status, 0, newest, Compared(FEWEST_ROWS, ()))


@pytest.fixture
def bench(link: Link) -> DeskBench:
    """In closed, with something found."""
    made = DeskBench(link)
    made.to_closed()
    made.finding = FOUND
    made.run(1)
    return made


def shadowed(bench: DeskBench, monkeypatch: pytest.MonkeyPatch, change: Callable[[Estimate], Estimate]) -> None:
    """The extended model runs in shadow."""

    def start(plan: ShadowPlan) -> None:
        bench.desk._shadows[TRIED] = Tried(change(bench.estimate))  # type: ignore[assignment]

    monkeypatch.setattr(bench.desk, "_start", start)
    assert "runs in shadow" in bench.ask(Action.SHADOW)


async def left(bench: DeskBench, stage: Stage) -> Progress:
    """Intervals until the card is at another stage."""
    limit = time.monotonic() + 120
    while True:
        progress = bench.interval()
        if bench.desk.card is not None and bench.desk.card.stage is not stage:
            return progress
        await asyncio.sleep(0.02)
        assert time.monotonic() < limit, bench.desk.card


def test_a_later_finding_takes_neither_the_card_while_building_nor_the_way_back(
    bench: DeskBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = bench.use.cycle

    async def run() -> Progress:
        shadowed(bench, monkeypatch, lambda e: e)
        bench.ask(Action.APPLY)
        bench.finding = LATER
        bench.run(1)
        card = bench.desk.card
        assert card is not None and card.finding is FOUND, "what is applied is what was asked for"
        assert "being built" in bench.ask(Action.REVERT)
        return await left(bench, Stage.BUILDING)

    progress = asyncio.run(run())
    assert bench.use.extended
    progress = bench.interval()
    assert progress.card is not None and progress.card.finding is LATER
    shown = Pictures(bench.link).of(progress)[1]
    assert (shown["reverts"], shown["effects"]) == (True, ["bubble size by air flow"])
    assert "in use again" in bench.ask(Action.REVERT)
    assert bench.use.cycle is base and not bench.use.extended
    assert bench.run(2)[-1].mode is Mode.CLOSED
    assert "no extended model" in bench.ask(Action.REVERT)


@pytest.mark.parametrize("problem", ["not finite", "ValueError: it failed"])
def test_an_extension_that_can_not_be_taken_up_leaves_the_model_in_use(
    bench: DeskBench, monkeypatch: pytest.MonkeyPatch, problem: str
) -> None:
    def fail(*told: Any) -> None:
        raise ValueError("it failed")

    def unknown(estimate: Estimate) -> Estimate:
        return replace(estimate, state=np.full_like(estimate.state, np.nan))

    async def run() -> None:
        shadowed(bench, monkeypatch, unknown if problem == "not finite" else lambda e: e)
        bench.ask(Action.APPLY)
        await left(bench, Stage.BUILDING)

    if problem != "not finite":
        monkeypatch.setattr(Cycle, "go_on", fail)
    base, said = bench.use.cycle, bench.desk.said
    told: dict[str, str] = {}
    monkeypatch.setattr(bench.desk, "said", lambda: (told.update(said()), {})[1])
    asyncio.run(run())
    assert bench.desk.card is not None and bench.desk.card.stage is Stage.FOUND
    assert bench.use.cycle is base and not bench.use.extended
    assert problem in told["model"]
    assert bench.run(2)[-1].mode is Mode.CLOSED


def test_an_extended_model_whose_shadow_has_ended_can_be_tried_again(
    bench: DeskBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    shadowed(bench, monkeypatch, lambda e: e)
    assert "nothing to try" in bench.ask(Action.SHADOW), "it runs"
    bench.desk._shadows[TRIED].status = "ended: it failed"  # type: ignore[attr-defined]
    assert "runs in shadow" in bench.ask(Action.SHADOW)


def test_a_process_that_can_not_be_started_is_a_status_and_an_alarm(
    bench: DeskBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(process: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", refused)
    assert "not tried: ended: can not be started (Resource" in bench.ask(Action.SHADOW)
    assert f"shadow {TRIED}" in bench.desk.alarms and bench.run(2)[-1].mode is Mode.CLOSED
    bench.desk.close()


def test_the_last_words_of_a_shadow_stay(link: Link) -> None:
    from tests.live.cycle.test_shadow import failing

    shadow = Shadow(link.path.absolute(), ShadowPlan("unbuilt", "rpem"), ("level",), failing)
    limit = time.monotonic() + 120
    while shadow.view().runs:
        shadow.collect()
        time.sleep(0.02)
        assert time.monotonic() < limit
    assert shadow._process is not None
    shadow._process.join()
    assert shadow.collect() == [] and "no such thing" in shadow.view().status
    shadow.close()
