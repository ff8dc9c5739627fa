"""Nobody without the token for acting changes anything, whatever he sends; and the page never makes the link wait."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.access import LASTS_S, MOST_SESSIONS, Access, Role
from adaptive_flot.live.page.hub import MOST_LISTENERS, MOST_WAITING
from adaptive_flot.live.page.server import MOST_CYCLES, PageServer
from adaptive_flot.live.requests import Action, Inbox
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.desk_bench import DeskBench
from tests.live.page_bench import ACT, VIEW, Visitor, page_keys, served, wait_for

SWITCH = {"action": "switch", "about": "off"}


@pytest.fixture(scope="module")
def paged(write_link: Callable[..., Link], scenario: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Link:
    """The short link with a page."""
    return write_link(scenario, {"controller": "pi", **page_keys(tmp_path_factory.mktemp("tokens"))})


@pytest.fixture(scope="module")
def shown(paged: Link) -> Progress:
    """A cycle in closed."""
    bench = DeskBench(paged)
    bench.to_closed()
    return bench.interval()


@pytest.fixture(scope="module")
def page(paged: Link, shown: Progress) -> Iterator[tuple[PageServer, Inbox]]:
    """A page that shows the cycle."""
    with served(paged) as (server, inbox):
        server.show(shown)
        yield server, inbox


@pytest.fixture
def inbox(page: tuple[PageServer, Inbox]) -> Inbox:
    """Where requests go, empty."""
    page[1].take()
    return page[1]


@pytest.fixture
def actor(page: tuple[PageServer, Inbox]) -> Visitor:
    """A person who may act."""
    visitor = Visitor(page[0])
    assert visitor.log_in(ACT, "A. Person") == 303
    return visitor


def test_a_person_who_may_act_is_heard_by_name(actor: Visitor, inbox: Inbox) -> None:
    assert actor.act(SWITCH) == 202
    (asked,) = inbox.take()
    assert (asked.person, asked.action, asked.about) == ("A. Person", Action.SWITCH, "off") and asked.asked


@pytest.mark.parametrize(
    "headers",
    [
        {"Cookie": None},
        {"Cookie": "guessed"},
        {"X-CSRF-Token": None},
        {"X-CSRF-Token": "guessed"},
        {"X-CSRF-Token": ""},
        {"Origin": None},
        {"Origin": "null"},
        {"Origin": "http://evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Content-Type": "text/plain"},
        {"Content-Type": "application/x-www-form-urlencoded"},
        {"Host": "evil.example"},
    ],
)
def test_forged_requests_change_nothing(actor: Visitor, inbox: Inbox, headers: dict[str, str | None]) -> None:
    if headers.get("Cookie"):
        headers = {"Cookie": f"{actor.cookie.split('=')[0]}=guessed"}
    assert actor.act(SWITCH, headers) in (401, 403, 421)
    assert inbox.take() == []


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b'"switch"',
        {},
        {"action": "write", "about": "air_flow"},
        {"action": "switch", "about": 3},
        {"action": "switch", "about": "x" * 300},
        {"action": "switch", "about": "off", "person": "B"},
        {"action": "acknowledge", "about": "all\0"},  # PostgreSQL refuses it, and the link would end
        {"action": "acknowledge", "about": "all\n7: closed: the plant has granted control"},
        {"action": "acknowledge", "about": "\x1b[2J"},
        {"action": ["switch"]},
        b'{"action": "switch", "about": "' + b"x" * 100_000 + b'"}',
        b'{"action":' * 1000,
    ],
)
def test_malformed_actions_change_nothing(actor: Visitor, inbox: Inbox, content: object) -> None:
    assert actor.act(content) in (400, 413)
    assert inbox.take() == []


def test_a_viewer_sees_and_changes_nothing(page: tuple[PageServer, Inbox], inbox: Inbox) -> None:
    viewer = Visitor(page[0])
    assert viewer.log_in(VIEW) == 303
    begun = viewer.begin()
    assert begun["who"]["may"] == "view" and begun["now"]["mode"] == "closed"
    assert viewer.act(SWITCH) == 403 and inbox.take() == []


def test_nobody_sees_anything_without_a_token(page: tuple[PageServer, Inbox], inbox: Inbox) -> None:
    visitor = Visitor(page[0])
    assert visitor.ask("GET", "/")[:2][0] == 303
    assert visitor.ask("GET", "/events")[0] == 401
    assert visitor.act(SWITCH) == 401 and inbox.take() == []
    pairs = (
        ("guessed-token-of-somebody", "A"),
        ("", "A"),
        (ACT[:-1], "A"),
        (ACT, ""),
        (ACT, "a\nb"),
        (ACT, "x" * 61),
    )
    for k, (token, name) in enumerate(pairs):
        visitor = Visitor(page[0], f"127.0.0.{10 + k}")
        assert visitor.log_in(token, name) == 403 and visitor.cookie == ""
    assert visitor.log_in(ACT, "A", {"Origin": "http://evil.example"}) == 403 and visitor.cookie == ""


def test_the_cookie_and_every_answer_are_locked_down(page: tuple[PageServer, Inbox], actor: Visitor) -> None:
    body = f"token={ACT}&name=A".encode()
    form = {"Content-Type": "application/x-www-form-urlencoded"}
    _, headers, _ = actor.ask("POST", "/login", form, body)
    cookie = headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and ACT not in cookie
    assert headers["location"] == "/", "no token in an address"
    for path in ("/", "/login", "/assets/page.js", "/nothing", "/events/"):
        _, headers, text = actor.ask("GET", path)
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy
        assert headers["x-content-type-options"] == "nosniff" and ACT not in text
    _, _, text = actor.ask("GET", "/")
    assert "<script src=" in text and text.count("<script") == 1 and "style=" not in text, "nothing inline"


def test_log_out_ends_the_session(actor: Visitor, inbox: Inbox) -> None:
    assert actor.ask("POST", "/logout", {"X-CSRF-Token": "guessed"})[0] == 403
    assert actor.ask("POST", "/logout", {"X-CSRF-Token": actor.csrf})[0] == 200
    assert actor.act(SWITCH) == 401 and inbox.take() == []


def test_other_methods_and_malformed_http_are_refused_and_the_server_goes_on(actor: Visitor, inbox: Inbox) -> None:
    for method in ("PUT", "DELETE", "PATCH", "GET"):
        assert actor.ask(method, "/action")[0] in (403, 405)
    for sent in (
        b"\x00\x01\x02\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"POST /action HTTP/1.1\r\nContent-Length: x\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 20_000,
        b"GET /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n",
    ):
        with socket.create_connection((actor.host, actor.port), timeout=20) as raw:
            try:
                raw.sendall(sent)
                answer = raw.recv(200)
            except ConnectionError:
                continue
            assert b" 4" in answer[:14] or answer == b""
    assert inbox.take() == [] and actor.act(SWITCH) == 202


@settings(max_examples=40, deadline=None)
@given(
    body=st.binary(max_size=300), path=st.text(st.characters(codec="ascii", categories=["L", "N", "P"]), max_size=20)
)
def test_whatever_is_sent_changes_nothing_without_the_token(
    page: tuple[PageServer, Inbox], body: bytes, path: str
) -> None:
    server, box = page
    box.take()
    visitor = Visitor(server)
    safe = "/" + "".join(c for c in path if c not in '\\#?%"<>^`{|}')
    assert visitor.ask("POST", safe, {"Content-Type": "application/json"}, body)[0] >= 400
    assert box.take() == []


def test_too_many_requests_are_refused(actor: Visitor, inbox: Inbox) -> None:
    answers = [actor.act({"action": "acknowledge", "about": "all"}) for _ in range(40)]
    assert answers.count(503) == 40 - len(inbox.take()) > 0


def test_a_browser_that_does_not_read_is_dropped_and_the_link_never_waits(paged: Link, shown: Progress) -> None:
    with served(paged) as (server, _):
        visitor = Visitor(server)
        visitor.log_in(VIEW)
        slow = visitor.stream()
        slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        wait_for(lambda: server.hub.listeners == 1)
        number = shown.outcome.number

        def show_more() -> bool:
            nonlocal number
            number += 1
            later = replace(shown.snapshot, time=shown.snapshot.time + number)
            server.show(replace(shown, snapshot=later, outcome=replace(shown.outcome, number=number)))
            return server.hub.listeners == 0

        wait_for(show_more)
        assert number > MOST_WAITING
        reader = Visitor(server)
        reader.log_in(VIEW)
        wait_for(lambda: reader.begin()["now"]["cycle"] == number)
        slow.close()


def test_a_page_whose_thread_stands_still_costs_the_link_nothing(paged: Link, shown: Progress) -> None:
    server = PageServer(paged, Inbox())
    for _ in range(3 * MOST_CYCLES):
        server.show(shown)  # nobody takes them: the oldest are left out
    assert len(server._cycles) == MOST_CYCLES
    server._socket.close()


def test_no_more_browsers_listen_than_the_hub_holds(paged: Link) -> None:
    with served(paged) as (server, _):
        listeners = [server.hub.join() for _ in range(MOST_LISTENERS + 1)]
        assert listeners[-1] is None and all(listeners[:-1])
        visitor = Visitor(server)
        body = f"token={VIEW}".encode()
        status, headers, _ = visitor.ask("POST", "/login", {"Content-Type": "application/x-www-form-urlencoded"}, body)
        assert status == 303
        visitor.cookie = headers["set-cookie"].split(";")[0]
        assert visitor.ask("GET", "/events")[0] == 503


def test_sessions_end_with_the_shift_and_are_bounded() -> None:
    now = 0.0
    access = Access(VIEW, ACT, lambda: now)
    first = access.log_in(ACT, "A")
    assert first is not None and first[1].role is Role.ACT
    now = LASTS_S - 1
    assert access.session(first[0]) is not None
    now = LASTS_S
    assert access.session(first[0]) is None
    acting = access.log_in(ACT, "A")
    keys = [made[0] for _ in range(MOST_SESSIONS + 1) if (made := access.log_in(VIEW, "")) is not None]
    assert acting is not None and access.session(acting[0]) is not None, "no viewer ends the session of one who acts"
    assert access.session(keys[0]) is None and access.session(keys[1]) is not None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"page.host": "0.0.0.0"}, "give certificate and key"),
        ({"page.certificate": "x.pem"}, "give both"),
        ({"page.act_token_file": "none.token"}, "can not be read"),
        ({"page.certificate": "none.pem", "page.key": "none.pem"}, "certificate and key can not be used"),
        ({"page.prot": 1}, "did you mean"),
    ],
)
def test_a_page_that_would_not_be_safe_is_refused(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    from tests.edits import edit

    with pytest.raises(LinkError, match=words):
        PageServer(write_link(scenario, edit({"controller": "pi", **page_keys(tmp_path)}, changes)), Inbox())


def test_tokens_must_differ_and_can_not_be_guessed(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path
) -> None:
    link = write_link(scenario, {"controller": "pi", **page_keys(tmp_path)})
    (tmp_path / "act.token").write_text(VIEW)
    with pytest.raises(LinkError, match="are the same"):
        PageServer(link, Inbox())
    (tmp_path / "act.token").write_text("short")
    with pytest.raises(LinkError, match="can be guessed"):
        PageServer(link, Inbox())


def test_a_port_in_use_is_one_clear_line(write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        link = write_link(scenario, {"controller": "pi", **page_keys(tmp_path, taken.getsockname()[1])})
        with pytest.raises(LinkError, match="can not listen"):
            PageServer(link, Inbox())
