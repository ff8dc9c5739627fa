"""What is served: the page, its stream, and the actions. Nothing here changes anything but through the inbox."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Annotated, Literal
from urllib.parse import parse_qs

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.requests import Request as HttpRequest
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from adaptive_flot.live.page.access import COOKIE, LASTS_S, Access, Role, Session, foreign, is_same
from adaptive_flot.live.page.assets import ASSETS, login_page, page
from adaptive_flot.live.page.attempts import Attempts
from adaptive_flot.live.page.hub import Hub
from adaptive_flot.live.page.stream import Stream
from adaptive_flot.live.requests import Action, Inbox, Request

LONGEST_BODY = 4096
HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}


def _printable(text: str) -> str:
    """Nothing that a database refuses (NUL) or that a console obeys; ValueError for another text."""
    if not text.isprintable():
        raise ValueError("holds characters that can not be shown")
    return text


class Asked(BaseModel):
    """Body of a request for an action."""

    model_config = ConfigDict(extra="forbid", strict=True)

    action: Literal["switch", "acknowledge", "shadow", "apply", "revert"]
    about: Annotated[str, Field(max_length=200), AfterValidator(_printable)] = ""


class _TooLongError(Exception):
    pass


class PageApplication:
    """The page as an ASGI application.

    Parameters
    ----------
    access
        Tokens and sessions.
    hub
        What is shown.
    inbox
        Where requests go.
    hosts
        Values of `Host` under which it is served.
    scheme
        `http` or `https`.
    port
        Where it is served. Cookies are the same for all ports of a host: pages of several links need names of their
        own.
    """

    def __init__(self, access: Access, hub: Hub, inbox: Inbox, hosts: frozenset[str], scheme: str, port: int) -> None:
        self._access, self._hub, self._inbox = access, hub, inbox
        self._origins = frozenset(f"{scheme}://{host}" for host in hosts)
        self._attempts = Attempts()
        self._secure = scheme == "https"
        # a browser takes a `__Host-` cookie from this very host only, over https
        self._cookie = f"{'__Host-' if self._secure else ''}{COOKIE}_{port}"
        routes = [
            Route("/", self._page, methods=["GET"]),
            Route("/login", self._login, methods=["GET", "POST"]),
            Route("/logout", self._logout, methods=["POST"]),
            Route("/events", self._events, methods=["GET"]),
            Route("/action", self._action, methods=["POST"]),
            Route("/assets/{name}", self._asset, methods=["GET"]),
        ]
        self.application = with_headers(Starlette(routes=routes), hosts)

    async def _page(self, request: HttpRequest) -> Response:
        if self._session(request) is None:
            return RedirectResponse("/login", 303)
        return Response(page(), media_type="text/html")

    async def _asset(self, request: HttpRequest) -> Response:
        found = ASSETS.get(request.path_params["name"])
        return PlainTextResponse("not found", 404) if found is None else Response(found[0](), media_type=found[1])

    async def _login(self, request: HttpRequest) -> Response:
        if request.method == "GET":
            return Response(login_page(""), media_type="text/html")
        why = foreign(request.headers, self._origins)
        if why:
            return PlainTextResponse(f"refused: {why}", 403)
        try:
            form = parse_qs((await _body(request)).decode("utf-8"), max_num_fields=8)
        except _TooLongError:
            return PlainTextResponse("refused: too long", 413)
        except (UnicodeError, ValueError):
            return PlainTextResponse("refused: no form", 400)
        address = "" if request.client is None else request.client.host
        wait = math.ceil(self._attempts.wait_s(address))
        if wait:
            words = f"Too many wrong tokens from this address: try again in {wait} s."
            return Response(login_page(words), 429, {"retry-after": str(wait)}, media_type="text/html")
        given = self._access.log_in(form.get("token", [""])[0].strip(), form.get("name", [""])[0])
        if given is None:
            self._attempts.failed(address)
            return Response(login_page("Wrong token, or no name."), 403, media_type="text/html")
        answer = RedirectResponse("/", 303)
        answer.set_cookie(
            self._cookie,
            given[0],
            max_age=int(LASTS_S),
            httponly=True,
            samesite="strict",
            secure=self._secure,
            path="/",
        )
        return answer

    async def _logout(self, request: HttpRequest) -> Response:
        session = self._session(request)
        if session is None or foreign(request.headers, self._origins) or not _has_csrf(request, session):
            return PlainTextResponse("refused", 403)
        self._access.log_out(request.cookies.get(self._cookie))
        answer = PlainTextResponse("logged out")
        answer.delete_cookie(self._cookie, path="/", httponly=True, samesite="strict", secure=self._secure)
        return answer

    async def _action(self, request: HttpRequest) -> Response:
        session = self._session(request)
        if session is None:
            return PlainTextResponse("refused: not logged in", 401)
        why = foreign(request.headers, self._origins)
        if not why and not _has_csrf(request, session):
            why = "it has no valid CSRF token"
        if not why and session.role is not Role.ACT:
            why = "this session may only look; log in with the token for acting"
        if not why and request.headers.get("content-type", "").split(";")[0] != "application/json":
            why = "it is no JSON"
        if why:
            return PlainTextResponse(f"refused: {why}", 403)
        try:
            asked = Asked.model_validate_json(await _body(request))
        except _TooLongError:
            return PlainTextResponse("refused: too long", 413)
        except ValidationError:
            return PlainTextResponse("refused: unknown action", 400)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        if not self._inbox.put(Request(session.name, Action(asked.action), asked.about, now)):
            return PlainTextResponse("refused: too many requests wait for the next cycle", 503)
        return PlainTextResponse("taken: the next cycle carries it out", 202)

    async def _events(self, request: HttpRequest) -> Response:
        key = request.cookies.get(self._cookie)
        session = self._access.session(key)
        if session is None:
            return PlainTextResponse("refused: not logged in", 401)
        listener = self._hub.join()
        if listener is None:
            return PlainTextResponse("refused: too many browsers listen", 503)
        who = {"name": session.name, "may": session.role.value, "csrf": session.csrf}
        return Stream(self._hub, listener, who, lambda: self._access.session(key) is not None)

    def _session(self, request: HttpRequest) -> Session | None:
        return self._access.session(request.cookies.get(self._cookie))


def _has_csrf(request: HttpRequest, session: Session) -> bool:
    return is_same(request.headers.get("x-csrf-token"), session.csrf)


async def _body(request: HttpRequest) -> bytes:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > LONGEST_BODY:
            raise _TooLongError
    return body


def with_headers(application: ASGIApp, hosts: frozenset[str]) -> ASGIApp:
    """Every answer has the headers of safety; a request under another name is refused (DNS rebinding)."""
    extra = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def safe(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return

        async def with_extra(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            await send(message)

        named: Mapping[bytes, bytes] = dict(scope["headers"])
        if named.get(b"host", b"").decode("latin-1").lower() not in hosts:
            await PlainTextResponse("refused: unknown host", 421)(scope, receive, with_extra)
            return
        await application(scope, receive, with_extra)

    return safe
