"""What bounds the connections to the page: how many there are, and how long each may take to ask.

The page lives in the process of the link. A stranger who opens connections and says nothing must not take the handles
that the link needs for its database and for the plant's server.
"""

from __future__ import annotations

import asyncio
import socket
import weakref
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_ACCEPTED = 128
"""Connections at a time, those in a TLS handshake too; whoever comes beyond that is let go at once."""
ASKS_WITHIN_S = 10.0
"""Time for a request with its body, or to take the rest of an answer; up to twice as long where it is looked at."""


class Listening(socket.socket):
    """A listening socket that holds a bounded number of connections.

    Parameters
    ----------
    made
        A listening socket, which is taken over.
    """

    def __init__(self, made: socket.socket) -> None:
        super().__init__(fileno=made.detach())
        self._held: weakref.WeakSet[socket.socket] = weakref.WeakSet()

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection; BlockingIOError, as where none waits, for one too many."""
        made, address = super().accept()
        if sum(held.fileno() >= 0 for held in self._held) >= MOST_ACCEPTED:
            made.close()
            raise BlockingIOError
        self._held.add(made)
        return made, address


class PatientProtocol(H11Protocol):
    """HTTP for browsers that ask in time: uvicorn itself waits for a request without end."""

    _looking: asyncio.TimerHandle | None = None
    _seen: object = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to look at the connection."""
        super().connection_made(transport)
        self._look_later()

    def connection_lost(self, exc: Exception | None) -> None:
        """Look no longer."""
        if self._looking is not None:
            self._looking.cancel()
        super().connection_lost(exc)

    def _look_later(self) -> None:
        self._looking = self.loop.call_later(ASKS_WITHIN_S, self._look)

    def _look(self) -> None:
        """End a connection that still waits for the same request, or to be closed, as when it was looked at before."""
        waits = self.conn.their_state in (h11.IDLE, h11.SEND_BODY) or self.transport.is_closing()
        now = (self.cycle, self.transport.is_closing()) if waits else None
        if now is not None and now == self._seen:
            self.transport.abort()
            return
        self._seen = now
        self._look_later()
