"""Who may see the page and who may act at it: tokens, sessions, and what a request must have before it counts."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

COOKIE = "adaptive_flot_live"
LASTS_S = 12 * 3600.0
"""A session ends so long after its log-in: a shift, with room for the hand-over."""
MOST_SESSIONS = 64
"""Of one role; older ones of it end where there are more, so that no viewer ends the session of one who acts."""
LONGEST_NAME = 60
LEAST_TOKEN = 20
"""Characters of a token; a shorter one could be guessed."""


class Role(Enum):
    """What a session may do."""

    VIEW = "view"
    ACT = "act"


@dataclass(frozen=True)
class Session:
    """A browser that has logged in.

    Attributes
    ----------
    name
        The person's own name; empty for a session that only looks.
    role
        What it may do.
    csrf
        What every action of it must carry beside the cookie.
    until
        When it ends [s of the clock].
    """

    name: str
    role: Role
    csrf: str
    until: float


class Access:
    """Tokens and sessions, in memory only: they end with the program.

    Parameters
    ----------
    view, act
        The tokens.
    clock
        Time [s], which does not go back.
    """

    def __init__(self, view: str, act: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._tokens = {Role.ACT: _digest(act), Role.VIEW: _digest(view)}
        self._sessions: dict[bytes, Session] = {}
        self._clock = clock

    def log_in(self, token: str, name: str) -> tuple[str, Session] | None:
        """Key for the cookie, and the session; None for a wrong token, or for acting without a name.

        Both tokens are compared in constant time, whatever the first comparison says.
        """
        given = _digest(token)
        right = [role for role, known in self._tokens.items() if hmac.compare_digest(given, known)]
        if not right or (right[0] is Role.ACT and not is_name(name)):
            return None
        session = Session(name.strip(), right[0], secrets.token_urlsafe(32), self._clock() + LASTS_S)
        key = secrets.token_urlsafe(32)
        self._sessions[_digest(key)] = session
        alike = [other for other, known in self._sessions.items() if known.role is session.role]
        for oldest in alike[:-MOST_SESSIONS]:
            del self._sessions[oldest]
        return key, session

    def session(self, key: str | None) -> Session | None:
        """The session of a cookie; None where there is none, or it has ended."""
        if not key:
            return None
        digest = _digest(key)
        session = self._sessions.get(digest)
        if session is not None and self._clock() >= session.until:
            del self._sessions[digest]
            return None
        return session

    def log_out(self, key: str | None) -> None:
        """End a session."""
        if key:
            self._sessions.pop(_digest(key), None)


def is_name(name: str) -> bool:
    """Whether a person's name can be stored and shown: printable, and neither empty nor long."""
    return 0 < len(name.strip()) <= LONGEST_NAME and name.isprintable()


def is_same(given: str | None, wanted: str) -> bool:
    """Compare in constant time."""
    return given is not None and hmac.compare_digest(_digest(given), _digest(wanted))


def foreign(headers: Mapping[str, str], origins: frozenset[str]) -> str:
    """Why a request that would change something does not come from this page; empty where it does.

    Parameters
    ----------
    headers
        Of the request, names in lower case.
    origins
        Origins under which the page is served.
    """
    if headers.get("origin") not in origins:
        return "it does not come from this page (Origin)"
    if headers.get("sec-fetch-site", "same-origin") != "same-origin":
        return "it does not come from this page (Sec-Fetch-Site)"
    return ""


def _digest(text: str) -> bytes:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()
