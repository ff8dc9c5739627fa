"""Whoever guesses tokens has to wait, longer every time; nobody at another address does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.attempts import FORGOTTEN_S, FREE, LONGEST_S, MOST_ADDRESSES, Attempts
from adaptive_flot.runner.scenario.scenario import Scenario
from tests.live.page_bench import ACT, VIEW, Visitor, page_keys, served


def test_the_wait_grows_with_each_wrong_token_up_to_a_minute_and_is_forgotten() -> None:
    now = 1000.0
    attempts = Attempts(lambda: now)
    waits = []
    for _ in range(12):
        attempts.failed("10.0.0.1")
        waits.append(attempts.wait_s("10.0.0.1"))
        now += waits[-1]
        assert attempts.wait_s("10.0.0.1") == 0
    assert waits[: FREE - 1] == [0.0] * (FREE - 1) and waits[FREE - 1 : FREE + 4] == [1, 2, 4, 8, 16]
    assert waits[-1] == LONGEST_S and attempts.wait_s("10.0.0.2") == 0
    now += FORGOTTEN_S
    attempts.failed("10.0.0.1")
    assert attempts.wait_s("10.0.0.1") == 0, "one wrong token in a quarter of an hour is a mistake"


def test_addresses_are_bounded_and_a_network_of_ipv6_counts_as_one() -> None:
    attempts = Attempts(lambda: 0.0)
    for k in range(FREE):
        attempts.failed(f"2001:db8::{k}")
    assert attempts.wait_s("2001:db8::ffff") > 0 and attempts.wait_s("2001:db8:0:1::1") == 0
    for k in range(MOST_ADDRESSES):
        attempts.failed(f"10.0.{k // 256}.{k % 256}")
    assert attempts.wait_s("2001:db8::ffff") == 0 and len(attempts._failed) == MOST_ADDRESSES


def test_a_guesser_is_held_up_and_a_person_elsewhere_is_not(
    write_link: Callable[..., Link], scenario: Scenario, tmp_path: Path
) -> None:
    with served(write_link(scenario, {"controller": "pi", **page_keys(tmp_path)})) as (server, _):
        person, guesser = Visitor(server), Visitor(server, "127.0.0.2")
        assert guesser.log_in(VIEW) == 303
        for k in range(FREE + 4):  # a slow machine may let a second pass meanwhile
            answer = guesser.log_in(f"guessed-token-number-{k:04}")
        assert answer == 429 and guesser.log_in(ACT, "A") == 429, "the right token is not even looked at"
        status, headers, text = guesser.ask("POST", "/login", {}, b"token=x")
        assert status == 429 and 1 <= int(headers["retry-after"]) <= LONGEST_S and "try again in" in text
        assert person.log_in(ACT, "A. Person") == 303 and person.act({"action": "switch", "about": "off"}) == 202
