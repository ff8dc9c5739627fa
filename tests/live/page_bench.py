"""A page served for cycles that a test shows it, and a client of plain HTTP."""

from __future__ import annotations

import http.client
import json
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urlparse

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.requests import Inbox

VIEW, ACT = "view-token-of-a-test-0001", "act-token-of-a-test-00002"


def page_keys(folder: Path, port: int = 0) -> dict[str, object]:
    """Changes of a link file that give it a page, with tokens in a folder."""
    for name, token in (("view", VIEW), ("act", ACT)):
        (folder / f"{name}.token").write_text(token + "\n")
    files = {f"{name}_token_file": str(folder / f"{name}.token") for name in ("view", "act")}
    return {"page": {"host": "127.0.0.1", "port": port, **files}}


@contextmanager
def served(link: Link) -> Iterator[tuple[PageServer, Inbox]]:
    """A page that is served, and where its requests go."""
    inbox = Inbox()
    server = PageServer(link, inbox)
    server.start()
    try:
        yield server, inbox
    finally:
        server.close()


class Visitor:
    """A browser without a screen, maybe at another address of the loopback network."""

    def __init__(self, server: PageServer, source: str = "127.0.0.1") -> None:
        self.source = source
        where = urlparse(server.address)
        assert where.hostname is not None and where.port is not None
        self.host, self.port = where.hostname, where.port
        self.origin = server.address.rstrip("/")
        self.cookie = ""
        self.csrf = ""

    def ask(
        self, method: str, path: str, headers: Mapping[str, str | None] | None = None, body: bytes | None = None
    ) -> tuple[int, dict[str, str], str]:
        """Status, headers and text of an answer; None leaves a header out."""
        connection = http.client.HTTPConnection(self.host, self.port, 20, (self.source, 0))
        sent = {"Cookie": self.cookie or None, "Origin": self.origin if method == "POST" else None, **(headers or {})}
        try:
            connection.request(method, path, body, {k: v for k, v in sent.items() if v is not None})
            answer = connection.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read().decode()
        finally:
            connection.close()

    def log_in(self, token: str, name: str = "", headers: Mapping[str, str | None] | None = None) -> int:
        """Log in; the status."""
        body = urlencode({"token": token, "name": name}).encode()
        form = {"Content-Type": "application/x-www-form-urlencoded", **(headers or {})}
        status, answered, _ = self.ask("POST", "/login", form, body)
        self.cookie = answered.get("set-cookie", "").split(";")[0]
        if status == 303:
            self.csrf = self.begin()["who"]["csrf"]
        return status

    def act(self, content: object, headers: Mapping[str, str | None] | None = None) -> int:
        """Ask for an action as the page does, with headers changed; the status."""
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        usual = {"Content-Type": "application/json", "X-CSRF-Token": self.csrf}
        return self.ask("POST", "/action", {**usual, **(headers or {})}, body)[0]

    def stream(self) -> socket.socket:
        """An open stream of events."""
        opened = socket.create_connection((self.host, self.port), timeout=20)
        opened.sendall(
            f"GET /events HTTP/1.1\r\nHost: {self.host}:{self.port}\r\nCookie: {self.cookie}\r\n\r\n".encode()
        )
        return opened

    def begin(self) -> dict[str, Any]:
        """First message of a stream."""
        with self.stream() as opened:
            text = b""
            while b"event: begin\ndata: " not in text or not text.split(b"event: begin\ndata: ")[1].count(b"\n"):
                more = opened.recv(65536)
                assert more, text
                text += more
        data = text.split(b"event: begin\ndata: ")[1].split(b"\n")[0]
        begun: dict[str, Any] = json.loads(data)
        return begun


def wait_for(condition: Any, seconds: float = 60.0) -> None:
    """Wait; the limit only ends a test that would wait for ever."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
