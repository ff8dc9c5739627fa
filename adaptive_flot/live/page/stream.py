"""Server-sent events to one browser."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from adaptive_flot.live.page.hub import Hub, Listener

PING_S = 10.0
SLOWEST_S = 5.0
"""A browser that does not take a message within this time is dropped."""


class Stream(Response):
    """An answer that ends with the browser's session, or where the browser does not keep up.

    Parameters
    ----------
    hub
        Where the messages come from.
    listener
        The browser's messages.
    who
        What is told of its session.
    valid
        Whether the session has not ended.
    """

    def __init__(self, hub: Hub, listener: Listener, who: dict[str, Any], valid: Callable[[], bool]) -> None:
        super().__init__(media_type="text/event-stream")
        self._hub, self._listener, self._who, self._valid = hub, listener, who, valid

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Tell until the browser is gone."""
        gone = asyncio.ensure_future(_disconnected(receive))
        telling = asyncio.ensure_future(self._tell(send))
        try:
            await asyncio.wait({gone, telling}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._hub.leave(self._listener)
            for task in (gone, telling):
                task.cancel()
            await asyncio.gather(gone, telling, return_exceptions=True)

    async def _tell(self, send: Send) -> None:
        headers = [(b"content-type", b"text/event-stream; charset=utf-8")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        message: str | None = "retry: 1000\n\n" + self._hub.begin(self._who)
        while not self._listener.dropped and self._valid():
            body = (message or ": nothing new\n\n").encode()
            part = {"type": "http.response.body", "body": body, "more_body": True}
            await asyncio.wait_for(send(part), SLOWEST_S)
            message = await self._listener.next(PING_S)
        await asyncio.wait_for(send({"type": "http.response.body", "body": b"", "more_body": False}), SLOWEST_S)


async def _disconnected(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
