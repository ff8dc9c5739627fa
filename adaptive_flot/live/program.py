"""Run a link until somebody ends it, and say what happens."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from adaptive_flot.errors import located
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.loop import quiet_libraries, settle, until_stopped
from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.requests import Inbox
from adaptive_flot.live.running.progress import Progress, Stage
from adaptive_flot.live.running.run import LinkRun
from adaptive_flot.live.running.watchdog import HungCycleError, end_now, unwatched_after, watch
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.memory import Memory, open_database


def live(link: Link, say: Callable[[str], None] = print, cycles: int | None = None) -> None:
    """Run a link.

    Parameters
    ----------
    link
        The link file and its scenario.
    say
        Told where the link starts from, and each change of mode and of what is wrong.
    cycles
        Number of cycles; default until it is ended.

    Raises
    ------
    LinkError
        A file, a tag, the database or the address of the page can not be used.
    """
    quiet_libraries()
    inbox, speaker = Inbox(), Speaker(say)
    page = None if link.file.page is None else PageServer(link, inbox)
    with located(link.path):
        database = open_database(link.file.database, link.path.parent)
    memory = Memory(database, link)
    try:
        for words in (_started(link, memory), *kept(link, memory)):
            say(words)
        shows: tuple[Callable[[Progress], None], ...] = (speaker,)
        if page is not None:
            page.start()
            shows = (speaker, page.show)
            say(f"Page: {page.address}")
        run = LinkRun(
            link, memory, lambda progress: _show(shows, progress), inbox, lambda: page_conditions(page), watch
        )
        settle()
        with unwatched_after():
            asyncio.run(_run(run, cycles))
        say(f"Session {memory.session}: ended after {run.state.number} cycles; control is with the plant")
    finally:
        if page is not None:
            page.close()
        memory.close()


def _show(shows: tuple[Callable[[Progress], None], ...], progress: Progress) -> None:
    for show in shows:
        show(progress)


async def _run(run: LinkRun, cycles: int | None) -> None:
    async with until_stopped() as stop:
        try:
            await run.run(stop, cycles)
        except HungCycleError as error:
            end_now(error)


def page_conditions(page: PageServer | None) -> dict[str, str]:
    """What is wrong with the page, by key."""
    return {PAGE: page.problem} if page is not None and page.problem else {}


def _started(link: Link, memory: Memory) -> str:
    begin = f"Session {memory.session}: {link.file.estimator} and {link.file.controller} on {link.file.server.url}, "
    if memory.resumed is None:
        return begin + "in monitor, with no stored estimate"
    where = f"session {memory.resumed.session}, cycle {memory.resumed.cycle}"
    return begin + f"in monitor, from the estimate of {where}; turn the switch to monitor and up again to go further"


def kept(link: Link, memory: Memory) -> list[str]:
    """What persons did at the page before the start and what still holds, one line each."""
    found = []
    if memory.resumed is not None and memory.resumed.effects:
        labels, person = [e.label for e in memory.resumed.effects], memory.resumed.extensions[-1].person
        found.append(f"The model in use is still extended by {', '.join(labels)} (applied by {person})")
    if memory.allowed < Mode.CLOSED:
        held = "raise it there to go further" if link.file.page is not None else "without a page it does not count"
        found.append(f"The page's switch was left at {memory.allowed.name.lower()}; {held}")
    return found


PAGE = "page"
"""Key of the alarm about the page."""


class Speaker:
    """Says what changes from cycle to cycle, one line each."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._faults: tuple[str, ...] = ()
        self._estimating = False
        self._stage: Stage | None = None
        self._page = ""
        self._unreachable = ""

    def __call__(self, progress: Progress) -> None:
        """Look at a cycle."""
        outcome = progress.outcome
        if outcome.reason:
            self._say(f"{outcome.number}: {outcome.mode.name.lower()}: {outcome.reason}")
        if outcome.estimate is not None and not self._estimating:
            self._estimating = True
            self._say(f"{outcome.number}: the estimator runs")
        for answered in progress.answered:
            asked = answered.request
            self._say(f"{outcome.number}: {asked.person}: {asked.action.value} {asked.about}: {answered.answer}")
        if progress.card is not None and progress.card.stage is not self._stage:
            self._stage = progress.card.stage
            by = f" by {progress.card.by}" if progress.card.by else ""
            self._say(f"{outcome.number}: extension of the model: {self._stage.value}{by}")
        if progress.found:
            self._say(f"{outcome.number}: discovery: {progress.found}")
        alarm = progress.alarms.get(PAGE)
        page = alarm.words if alarm is not None and alarm.active else ""
        if page != self._page:
            self._page = page
            self._say(f"{outcome.number}: {page or 'the page runs again'}")
        if progress.unreachable != self._unreachable:
            self._unreachable = progress.unreachable
            self._say(f"{outcome.number}: {progress.unreachable or 'connected to the plant'}")
        if outcome.faults != self._faults:
            self._faults = outcome.faults
            self._say(f"{outcome.number}: {'; '.join(outcome.faults) or 'all is well again'}")
