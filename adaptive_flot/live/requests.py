"""What persons ask for at the page, on its way to the loop of the link. A page changes nothing by itself."""

from __future__ import annotations

import queue
from dataclasses import dataclass
from enum import Enum

MOST_WAITING = 32
"""Requests that wait for the next cycle; more are refused."""


class Action(Enum):
    """What a person may ask for."""

    SWITCH = "switch"
    ACKNOWLEDGE = "acknowledge"
    SHADOW = "shadow"
    APPLY = "apply"
    REVERT = "revert"


@dataclass(frozen=True)
class Request:
    """What a person asks for.

    Attributes
    ----------
    person
        Who asks.
    action
        What for.
    about
        Position of the switch, key of the alarm; empty for the rest.
    asked
        Date and time of this machine.
    """

    person: str
    action: Action
    about: str = ""
    asked: str = ""


@dataclass(frozen=True)
class Answered:
    """A request and what came of it."""

    request: Request
    answer: str


class Inbox:
    """Requests between the thread of the page and the loop of the link; it never makes either wait."""

    def __init__(self) -> None:
        self._waiting: queue.Queue[Request] = queue.Queue(MOST_WAITING)

    def put(self, request: Request) -> bool:
        """Hand a request in; False where too many wait."""
        try:
            self._waiting.put_nowait(request)
        except queue.Full:
            return False
        return True

    def take(self) -> list[Request]:
        """Take out all that wait, oldest first."""
        found: list[Request] = []
        while len(found) < MOST_WAITING:
            try:
                found.append(self._waiting.get_nowait())
            except queue.Empty:
                break
        return found
