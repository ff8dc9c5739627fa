"""Strangers who open connections and say nothing take neither the page nor a handle of the link for long."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page import connections
from adaptive_flot.live.page.server import PageServer, _hosts
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.page_bench import VIEW, Visitor, page_keys, served, wait_for


@pytest.fixture
def server(write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path) -> Iterator[PageServer]:
    """A page that shows nothing yet."""
    with served(write_link(scenario, {"controller": "pi", **page_keys(tmp_path)})) as (server, _):
        yield server


def opened(visitor: Visitor, sent: bytes = b"") -> socket.socket:
    made = socket.create_connection((visitor.host, visitor.port), timeout=20)
    made.sendall(sent)
    return made


def wait_for_end(connection: socket.socket) -> None:
    """Until the other side has let go, whatever it answers before; TimeoutError where it does not."""
    try:
        while connection.recv(65536):
            pass
    except ConnectionError:
        pass


@pytest.mark.parametrize(
    "sent",
    [
        "",
        "GET / HTTP/1.1\r\nHost: ",
        "POST /login HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nContent-Length: 9\r\n\r\ntoken",
    ],
)
def test_whoever_does_not_ask_in_time_is_let_go(server: PageServer, monkeypatch: pytest.MonkeyPatch, sent: str) -> None:
    monkeypatch.setattr(connections, "ASKS_WITHIN_S", 0.2)
    visitor = Visitor(server)
    with opened(visitor, sent.format(host=f"{visitor.host}:{visitor.port}").encode()) as connection:
        wait_for_end(connection)


def test_a_stream_is_not_taken_for_a_slow_request(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    visitor = Visitor(server)
    assert visitor.log_in(VIEW) == 303
    wait_for(lambda: server.hub.listeners == 0)
    monkeypatch.setattr(connections, "ASKS_WITHIN_S", 0.05)
    with visitor.stream(), opened(visitor) as silent:
        wait_for(lambda: server.hub.listeners == 1)
        wait_for_end(silent)
        assert server.hub.listeners == 1


def test_no_more_connections_are_held_than_allowed(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MOST_ACCEPTED", 3)
    visitor = Visitor(server)
    held = [opened(visitor) for _ in range(3)]
    with opened(visitor) as further:
        wait_for_end(further)
    for connection in held:
        connection.close()

    def answers() -> bool:
        try:
            return visitor.ask("GET", "/login")[0] == 200
        except OSError:
            return False

    wait_for(answers)


def test_pages_of_two_links_do_not_take_each_others_cookie(
    server: PageServer, write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path
) -> None:
    """A browser sends the cookies of a host to all its ports, and keeps one of a name."""
    with served(write_link(scenario, {"controller": "pi", **page_keys(tmp_path)})) as (other, _):
        first, second = Visitor(server), Visitor(other)
        assert first.log_in(VIEW) == second.log_in(VIEW) == 303
        kept = dict(visitor.cookie.split("=", 1) for visitor in (first, second))
        first.cookie = second.cookie = "; ".join(f"{name}={key}" for name, key in kept.items())
        assert [visitor.ask("GET", "/")[0] for visitor in (first, second)] == [200, 200]


@pytest.mark.parametrize(
    ("name", "hosts"),
    [
        ("127.0.0.1", ["127.0.0.1:8050"]),
        ("::1", ["[::1]:8050"]),
        ("2001:db8::7", ["[2001:db8::7]:8050"]),
        ("cell7.example:443", ["cell7.example:443"]),
        ("[2001:db8::7]:443", ["[2001:db8::7]:443"]),
    ],
)
def test_a_page_is_reached_under_its_own_address(name: str, hosts: list[str]) -> None:
    assert _hosts(name, 8050) == hosts
