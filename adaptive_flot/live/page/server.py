"""The server of the page in a thread of its own. The loop of the link fills its mailbox and never waits for it."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections import deque
from pathlib import Path

import uvicorn

from adaptive_flot.errors import LinkError
from adaptive_flot.live.certificates import read_password
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.link_keys import LOOPBACK, PagePart
from adaptive_flot.live.page.access import LEAST_TOKEN, Access
from adaptive_flot.live.page.application import PageApplication
from adaptive_flot.live.page.connections import MOST_ACCEPTED, Listening, PatientProtocol
from adaptive_flot.live.page.hub import Hub
from adaptive_flot.live.requests import Inbox
from adaptive_flot.live.running.progress import Progress

MOST_CYCLES = 64
"""Cycles that wait for the thread of the page; where it can not keep up, the oldest are left out."""
MOST_CONNECTIONS = 100
ENDS_WITHIN_S = 5.0


class PageServer:
    """The page of a link.

    Parameters
    ----------
    link
        The link file, with the key `page`.
    inbox
        Where requests of persons go.

    Attributes
    ----------
    address
        Where browsers find it.
    problem
        What keeps the page from showing the cycles, in words; empty for nothing.

    Raises
    ------
    LinkError
        A token can not be read or is too short, both are the same, the port is in use, or certificate and key can not
        be used.
    """

    def __init__(self, link: Link, inbox: Inbox) -> None:
        part = link.file.page
        assert part is not None
        view, act = (_token(link.beside(name)) for name in (part.view_token_file, part.act_token_file))
        if view == act:
            raise LinkError(f"{link.path}: page: the tokens for viewing and for acting are the same; make another one")
        self._socket = _listening(link.path, part)
        port = self._socket.getsockname()[1]
        scheme = "http" if part.certificate is None else "https"
        names = dict.fromkeys([part.host, *(LOOPBACK if part.host in LOOPBACK else ()), *part.names])
        hosts = frozenset(n.lower() for name in names for n in _hosts(name, port))
        self.address = f"{scheme}://{_hosts(part.host, port)[0]}/"
        self.hub = Hub(link)
        made = PageApplication(Access(view, act), self.hub, inbox, hosts, scheme, port)
        config = uvicorn.Config(
            made.application,
            http=PatientProtocol,
            ws="none",
            lifespan="off",
            loop="asyncio",
            log_config=None,
            access_log=False,
            server_header=False,
            proxy_headers=False,
            limit_concurrency=MOST_CONNECTIONS,
            backlog=MOST_ACCEPTED,
            h11_max_incomplete_event_size=16384,
            timeout_graceful_shutdown=1,
            ssl_certfile=None if part.certificate is None else str(link.beside(part.certificate)),
            ssl_keyfile=None if part.key is None else str(link.beside(part.key)),
        )
        try:
            config.load()
        except OSError as error:  # also what is wrong with a certificate (ssl.SSLError)
            self._socket.close()
            raise LinkError(
                f"{link.path}: page: certificate and key can not be used ({error.strerror or error})"
            ) from error
        self._server = uvicorn.Server(config)
        self._cycles: deque[Progress] = deque(maxlen=MOST_CYCLES)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._fresh: asyncio.Event | None = None
        self._started = threading.Event()
        self._ended = self._unshown = ""
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def start(self) -> None:
        """Serve, until `close`."""
        self._thread.start()
        self._started.wait(ENDS_WITHIN_S)

    def show(self, progress: Progress) -> None:
        """Put a cycle into the mailbox; never waits."""
        self._cycles.append(progress)
        loop, fresh = self._loop, self._fresh
        if loop is not None and fresh is not None and not fresh.is_set():
            try:
                loop.call_soon_threadsafe(fresh.set)
            except RuntimeError:  # the thread has ended
                self._loop = None

    @property
    def problem(self) -> str:
        """See the class."""
        if self._started.is_set() and not self._thread.is_alive():
            return f"the page has ended{self._ended}; the link goes on; start the link again to have the page back"
        if len(self._cycles) == MOST_CYCLES:
            return "the page does not keep up: browsers see old cycles, or none"
        return self._unshown and f"the page can not show the cycles ({self._unshown})"

    def close(self) -> None:
        """Stop serving."""
        loop = self._loop
        if loop is not None:
            with contextlib.suppress(RuntimeError):  # the thread has ended
                loop.call_soon_threadsafe(self.hub.close)
        self._server.should_exit = True
        if self._started.is_set():
            self._thread.join(ENDS_WITHIN_S)
        self._socket.close()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:  # the link goes on, and raises an alarm
            self._ended = f" ({type(error).__name__}: {error})"
        finally:
            self._started.set()

    async def _serve(self) -> None:
        self._loop, self._fresh = asyncio.get_running_loop(), asyncio.Event()
        telling = asyncio.create_task(self._tell(self._fresh))
        self._started.set()
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            self._loop = None
            telling.cancel()

    async def _tell(self, fresh: asyncio.Event) -> None:
        while True:
            await fresh.wait()
            fresh.clear()
            while self._cycles:
                try:
                    self.hub.publish(self._cycles.popleft())
                    self._unshown = ""
                except Exception as error:  # browsers see that no cycle comes; the link goes on, and raises an alarm
                    self._unshown = f"{type(error).__name__}: {error}"
                await asyncio.sleep(0)


def _token(file: Path) -> str:
    token = read_password(file)
    if len(token) < LEAST_TOKEN:
        raise LinkError(f"{file}: a token of {len(token)} characters can be guessed; give {LEAST_TOKEN} or more")
    return token


def _hosts(name: str, port: int) -> list[str]:
    """Values of `Host` for a name: with the port, unless it has one; an address of IPv6 in brackets."""
    if name.count(":") > 1 and not name.startswith("["):
        name = f"[{name}]"
    return [name] if ":" in name.rpartition("]")[2] else [f"{name}:{port}", *([name] if port in (80, 443) else [])]


def _listening(path: Path, part: PagePart) -> socket.socket:
    family = socket.AF_INET6 if ":" in part.host else socket.AF_INET
    try:
        made = socket.create_server((part.host, part.port), family=family)
    except OSError as error:
        raise LinkError(
            f"{path}: page: can not listen at {part.host}:{part.port} ({error.strerror or error})"
        ) from error
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # a browser that is cut off must not keep its connection
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 10_000)
    return Listening(made)
