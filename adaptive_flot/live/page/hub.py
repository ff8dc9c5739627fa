"""The last hour, and the browsers that listen. It lives in the thread of the page; the link only fills the mailbox."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from typing import Any

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.picture import Pictures
from adaptive_flot.live.running.progress import Progress

HOUR_S = 3600.0
MOST_ROWS = 7200
MOST_LISTENERS = 32
MOST_WAITING = 20
"""Messages that a browser may be behind; it is dropped then, and may come again."""
MOST_ANSWERS = 30


class Listener:
    """One browser's messages."""

    def __init__(self) -> None:
        self._messages: asyncio.Queue[str | None] = asyncio.Queue(MOST_WAITING)
        self.dropped = False

    def put(self, message: str) -> None:
        """Hand a message over; a browser that has too many waiting is dropped."""
        try:
            self._messages.put_nowait(message)
        except asyncio.QueueFull:
            self.dropped = True

    def end(self) -> None:
        """Wake whoever waits, for the last time."""
        self.dropped = True
        if not self._messages.full():
            self._messages.put_nowait(None)

    async def next(self, within_s: float) -> str | None:
        """The next message; None where none has come within a time [s]."""
        try:
            return await asyncio.wait_for(self._messages.get(), within_s)
        except TimeoutError:
            return None


class Hub:
    """Makes pictures of cycles, keeps the last hour of them as text, and hands them to whoever listens.

    Parameters
    ----------
    link
        The link file and its scenario.
    """

    def __init__(self, link: Link) -> None:
        self._pictures = Pictures(link)
        self._spec = json.dumps(self._pictures.spec())
        rows = min(MOST_ROWS, round(HOUR_S / link.scenario.dt) + 1)
        self._rows: deque[str] = deque(maxlen=rows)
        self._last = float("-inf")
        self._now = "null"
        self._answers: deque[dict[str, Any]] = deque(maxlen=MOST_ANSWERS)
        self._listeners: set[Listener] = set()

    @property
    def listeners(self) -> int:
        """How many browsers listen."""
        return len(self._listeners)

    def publish(self, progress: Progress) -> None:
        """Take a cycle up and tell everybody."""
        row, now = self._pictures.of(progress)
        for answered in progress.answered:
            asked = answered.request
            self._answers.append(
                {
                    "at": asked.asked,
                    "person": asked.person,
                    "action": f"{asked.action.value} {asked.about}".strip(),
                    "answer": answered.answer,
                }
            )
        self._now = json.dumps({**now, "answers": list(self._answers)}, allow_nan=False)
        text = json.dumps(row, allow_nan=False)
        time = row[0]
        if time is None:  # the plant has told nothing yet
            text = "null"
        elif time < self._last - HOUR_S / 60:  # the plant's clock went back: what was before can not be shown beside it
            self._rows.clear()
        elif time <= self._last:
            text = "null"
        if text != "null":
            self._rows.append(text)
            self._last = time
        self._tell(f'event: cycle\ndata: {{"row":{text},"now":{self._now}}}\n\n')

    def begin(self, who: dict[str, Any]) -> str:
        """The first message to a browser: what stays the same, who it is, the last hour, and now."""
        rows = ",".join(self._rows)
        return (
            f'event: begin\ndata: {{"spec":{self._spec},"who":{json.dumps(who)},"rows":[{rows}],"now":{self._now}}}\n\n'
        )

    def join(self) -> Listener | None:
        """Listen; None where too many do."""
        if len(self._listeners) >= MOST_LISTENERS:
            return None
        listener = Listener()
        self._listeners.add(listener)
        return listener

    def leave(self, listener: Listener) -> None:
        """Listen no longer."""
        self._listeners.discard(listener)

    def close(self) -> None:
        """Let all browsers go."""
        for listener in self._listeners:
            listener.end()
        self._listeners.clear()

    def _tell(self, message: str) -> None:
        for listener in list(self._listeners):
            listener.put(message)
            if listener.dropped:
                self._listeners.discard(listener)
