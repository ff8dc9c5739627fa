"""The loop of the link: snapshot, cycle, storage, writes. It never waits longer than an interval for anything."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link.client import LOST, PlantClient, no_connection
from adaptive_flot.live.link.cycle import CycleState
from adaptive_flot.live.link.discovery import LiveDiscovery
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome, Written
from adaptive_flot.live.requests import Answered, Inbox
from adaptive_flot.live.running.desk import Desk
from adaptive_flot.live.running.model_use import ModelUse
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.running.watchdog import ORDERLY_S, HungCycleError, longest_cycle_s
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store.beside import Beside
from adaptive_flot.live.store.memory import Memory

T = TypeVar("T")
PATIENCE = 1.5
"""Intervals without a new sample after which a cycle counts as one without."""
LEAST_PATIENCE_S = 0.2
"""The same in seconds of this machine, for plants that run faster than real time."""
SILENT_INTERVALS = 5
"""Cycles without a sample after which the connection is taken for lost and made anew."""
RETRY_S = 0.5
"""Time between two attempts to connect [s of this machine]."""
NOTHING = Snapshot(float("nan"), False, {}, {}, {}, None, False)


class LinkRun:
    """Runs a link until it is told to stop.

    Parameters
    ----------
    link
        The link file and its scenario.
    memory
        Where everything is stored.
    show
        Called after each cycle; it must not wait for anything.
    inbox
        What persons ask for at the page.
    conditions
        What is wrong beside the cycles, in words by key: it raises alarms.
    watch
        Called in each cycle with the time until the next call [s]; see `watchdog.py`.

    Attributes
    ----------
    state
        After the last cycle.
    use
        The model in use, with its cycle.
    desk
        What happens beside the cycles.
    """

    def __init__(
        self,
        link: Link,
        memory: Memory,
        show: Callable[[Progress], None] = lambda progress: None,
        inbox: Inbox | None = None,
        conditions: Callable[[], Mapping[str, str]] = dict,
        watch: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        self.link, self.memory, self.inbox = link, memory, inbox or Inbox()
        self.use = ModelUse(link, () if memory.resumed is None else memory.resumed.extensions)
        self.discovery = LiveDiscovery(link, effects=self.use.cycle.effects)
        allowed = Mode.CLOSED if link.file.page is None else memory.allowed  # nobody could raise it without a page
        self.desk = Desk(link, self.use, inputs_since=lambda t: self.discovery.inputs_since(t), allowed=allowed)
        self.state: CycleState = self.use.cycle.start(None if memory.resumed is None else memory.resumed.prior)
        self._show, self._conditions, self._watch = show, conditions, watch
        self._stopping: asyncio.Future[Any] | None = None
        self._interval = link.scenario.dt / link.file.cycle.speed  # of this machine
        self._client: PlantClient | None = None
        self._connecting: asyncio.Task[PlantClient] | None = None
        self._silent = 0
        self._unreachable = ""

    async def run(self, stop: asyncio.Event, cycles: int | None = None) -> None:
        """Cycle until `stop` is set, or so many times; then give control back.

        Raises
        ------
        LinkError
            The database fails, or the first connection shows that a file or a tag is wrong.
        HungCycleError
            A cycle does not end: its thread goes on, and the process must end.
        """
        stopping = self._stopping = asyncio.ensure_future(stop.wait())
        in_time = True
        written: dict[str, Written] = {}
        try:
            while not stop.is_set() and (cycles is None or self.state.number < cycles):
                in_time, written = await self._one(in_time, written)
        finally:
            stopping.cancel()
            self.discovery.close()
            self.desk.close()
            await self._leave()

    async def _one(self, in_time: bool, before: Mapping[str, Written]) -> tuple[bool, dict[str, Written]]:
        """One cycle; whether it was in time, and what came of its writes."""
        client = await self._connected()
        alive = await self._wait(client)
        longest = longest_cycle_s(self.link, self.state.estimation.inner is not None)
        self._watch(longest + PATIENCE * self._interval + ORDERLY_S)
        loop = asyncio.get_running_loop()
        begin = loop.time()
        well = all(not result.problem for result in before.values())
        answered = self.desk.answer(self.inbox.take())
        self.state, change = self.desk.change_model(self.state)
        if change is not None:
            self.discovery.close()
            self.discovery = LiveDiscovery(self.link, effects=change.effects)
        snapshot = NOTHING if client is None else client.snapshot(alive, in_time, well)
        snapshot = replace(snapshot, allowed=self.desk.allowed)
        self.state, outcome = await self._ended(client, asyncio.to_thread(self.use.cycle.step, self.state, snapshot))
        found = self.discovery.look(outcome)
        began = self.state.estimation.began
        self.desk.after(outcome, began, self.discovery.finding, self._conditions())
        beside = Beside(answered, self.desk.said(), self.desk.results(), change)
        stored = asyncio.to_thread(self.memory.store, snapshot, outcome, began, before, found, beside)
        await self._ended(client, stored)
        seconds = loop.time() - begin
        in_time = seconds <= self.link.file.cycle.deadline * self._interval
        written = await self._tell(client, outcome, in_time)
        self._show(self._progress(snapshot, outcome, seconds, found, client is not None, answered))
        return in_time, written

    def _progress(
        self,
        snapshot: Snapshot,
        outcome: Outcome,
        seconds: float,
        found: str,
        connected: bool,
        answered: tuple[Answered, ...],
    ) -> Progress:
        state, desk = self.state, self.desk
        beside = desk.alarms, desk.card, desk.shadows(), answered, self.use.extended, self._unreachable
        return Progress(
            snapshot, outcome, seconds, found, connected, state.modes, state.histories, self.use.cycle.model, *beside
        )

    async def _ended(self, client: PlantClient | None, part: Coroutine[Any, Any, T]) -> T:
        """A part of the cycle; one that does not end (a solver, a database) gives control back, then ends the link."""
        working = asyncio.create_task(part)
        patience = max(self.link.file.cycle.shed_after * self._interval, LEAST_PATIENCE_S)
        await asyncio.wait({working}, timeout=patience)
        if working.done():
            return working.result()
        if client is not None and self.state.modes.mode is Mode.CLOSED:
            with contextlib.suppress(*LOST):
                await client.tell(self.state.number + 1, False, f"{Mode.SHED.name.lower()}: a cycle does not end")
        longest = longest_cycle_s(self.link, self.state.estimation.inner is not None)
        waits: set[asyncio.Future[Any]] = {working} if self._stopping is None else {working, self._stopping}
        await asyncio.wait(waits, timeout=longest - patience, return_when=asyncio.FIRST_COMPLETED)
        if self._stopping is not None and self._stopping.done():  # Ctrl-C: a cycle that is only slow comes to its end
            await asyncio.wait({working}, timeout=ORDERLY_S)
        if not working.done():
            raise HungCycleError(
                f"cycle {self.state.number + 1} does not end: what it calls (solver, plug-in, database) hangs; control "
                "is with the plant; start the link again: it goes on from the last stored estimate, in monitor"
            )
        return working.result()

    async def _tell(self, client: PlantClient | None, outcome: Outcome, in_time: bool) -> dict[str, Written]:
        """Heartbeat, request and mode; then the set-points, unless the cycle took too long."""
        if client is None:
            return _not_written(outcome, "not connected")
        words = outcome.mode.name.lower() + (f": {outcome.reason}" if outcome.reason else "")
        try:
            await client.tell(outcome.number, outcome.asks_control, words)
        except LOST as error:
            self._silent = SILENT_INTERVALS
            return _not_written(outcome, f"no heartbeat ({type(error).__name__})")
        if not in_time:
            return _not_written(outcome, "the cycle took too long")
        return await client.write(outcome.writes) if outcome.writes else {}

    async def _wait(self, client: PlantClient | None) -> bool:
        patience = max(PATIENCE * self._interval, LEAST_PATIENCE_S)
        if client is None:
            await asyncio.sleep(patience)
            return False
        alive = await client.new_sample(patience)
        self._silent = 0 if alive else self._silent + 1
        return alive

    async def _connected(self) -> PlantClient | None:
        """The client; None while there is none. It is made beside the cycles, which go on without it."""
        if self._client is not None and self._silent >= SILENT_INTERVALS:
            lost, self._client = self._client, None
            await lost.close()
        if self._client is None:
            if self._connecting is None:
                self._connecting = asyncio.create_task(self._connect())
            if self._connecting.done():
                self._client, self._connecting, self._silent = self._connecting.result(), None, 0
        return self._client

    async def _connect(self) -> PlantClient:
        while True:
            client = PlantClient(self.link, min(self.link.file.server.timeout_s, max(self._interval, LEAST_PATIENCE_S)))
            try:
                await client.connect()
                self._unreachable = ""
                return client
            except LinkError:
                raise
            except LOST as error:
                self._unreachable = no_connection(self.link.file.server.url, error)
                await asyncio.sleep(RETRY_S)

    async def _leave(self) -> None:
        """Give control back: the plant's own loop takes over at once, not after its watchdog."""
        if self._connecting is not None:
            self._connecting.cancel()
            with contextlib.suppress(asyncio.CancelledError, LinkError, *LOST):
                late = await self._connecting
                await late.close()
        if self._client is not None:
            with contextlib.suppress(*LOST):
                await self._client.tell(self.state.number + 1, False, f"{Mode.OFF.name.lower()}: the link has stopped")
            await self._client.close()
            self._client = None


def _not_written(outcome: Outcome, why: str) -> dict[str, Written]:
    return {name: Written(value, float("nan"), why) for name, value in outcome.writes.items()}
