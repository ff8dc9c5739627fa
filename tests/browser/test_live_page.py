"""The page of a running link in a browser: every mode and alarm is seen, and a person's clicks arrive by name."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from adaptive_flot.contracts import Decision, Plan, Status
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.alarms import Alarm
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.live.requests import Action, Answered, Inbox, Request
from adaptive_flot.live.running.progress import Card, Progress, Stage
from adaptive_flot.live.running.run import NOTHING
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.shadow.comparison import Compared
from adaptive_flot.live.shadow.process import ShadowView
from adaptive_flot.live.shadow.worker import ShadowPlan
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.browser.chromium import Browser, Tab
from tests.browser.pages import SETTLED, WIDTHS, errors, opened
from tests.live.conftest import CONTENT
from tests.live.desk_bench import DeskBench
from tests.live.page_bench import ACT, VIEW, page_keys, served

EFFECT = Effect("bubble_size", "air_flow", "linear", {"slope": 0.2}, {"reference": 1.5e-3})
FINDING = Finding(
    "named",
    "since 14:05 froth recovery is 20 % lower <script>document.title='broken in'</script>",
    ("concentrate_grade: residual 3.1 x the noise", "<img src=x onerror=alert(1)>"),
    (("concentrate_grade", "-", 2.1e-3, 1.1e-3),),
    (EFFECT,),
)
LARGEST_SCRIPTS = 300_000
SEEN = """
    new Promise((done, fail) => {{
      const end = performance.now() + 30000;
      const look = () => {{
        const found = (() => {{ try {{ return {condition}; }} catch (error) {{ return false; }} }})();
        if (found) return done(found);
        if (performance.now() > end) return fail(new Error("waited in vain for " + {words}));
        setTimeout(look, 20);
      }};
      look();
    }})
"""


@dataclass
class Shown:
    """A page that is served, and what it is shown."""

    server: PageServer
    inbox: Inbox
    last: Progress

    def show(self, **changes: Any) -> Progress:
        """Show the next cycle, with parts of progress, outcome or snapshot changed."""
        now = self.last
        outcome = {k: changes.pop(k) for k in list(changes) if k in vars(now.outcome) and k != "sample"}
        snapshot = {k: changes.pop(k) for k in list(changes) if k in vars(now.snapshot)}
        later = replace(now.snapshot, time=now.snapshot.time + 1)
        self.last = replace(now, snapshot=later, outcome=replace(now.outcome, number=now.outcome.number + 1))
        shown = replace(
            self.last,
            snapshot=replace(self.last.snapshot, **snapshot),
            outcome=replace(self.last.outcome, **outcome),
            **changes,
        )
        self.server.show(shown)
        return shown


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    """A page that has seen some minutes of a link in closed."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "short_live.yaml").write_text(CONTENT)
    made = link_text(load_scenario(folder / "short_live.yaml"), "opc.tcp://127.0.0.1:4840/x", folder)
    content = {**yaml.safe_load(made), "scenario": "short_live.yaml", "controller": "pi", **page_keys(folder)}
    (folder / "link.yaml").write_text(yaml.safe_dump(content))
    link = load_link(folder / "link.yaml")
    bench = DeskBench(link)
    with served(link) as (server, inbox):
        bench.to_closed()
        for _ in range(150):
            last = bench.interval()
            server.show(last)
        yield Shown(server, inbox, last)


def visit(browser: Browser, shown: Shown, token: str, width: int = 1400) -> Tab:
    """Log in as a person does."""
    tab = opened(browser, apart=True)
    tab.look(width, 900, dark=False)
    log_in(browser, tab, shown.server, token)
    seen(tab, "!document.body.classList.contains('waiting')")
    shown.show()
    seen(tab, "document.querySelector('#over-time').dataset.newest")
    return tab


def log_in(browser: Browser, tab: Tab, server: PageServer, token: str) -> None:
    """Fill the form in and send it."""
    tab.go(server.address)
    fill = f"document.querySelector('[name=token]').value = {json.dumps(token)};"
    tab.run(f"{fill} document.querySelector('[name=name]').value = 'A. Person'")
    browser.events = [e for e in browser.events if e.get("method") != "Page.loadEventFired"]
    tab.run("document.querySelector('form').submit()")
    browser.wait_for("Page.loadEventFired", tab.session)


@pytest.fixture(scope="module")
def person(browser: Browser, shown: Shown) -> Iterator[Tab]:
    """The page, open for a person who may act."""
    tab = visit(browser, shown, ACT)
    yield tab
    tab.close()


@pytest.fixture
def tab(person: Tab, shown: Shown) -> Tab:
    """The same, with nothing asked for and nothing wrong."""
    shown.inbox.take()
    time = shown.show().snapshot.time
    # Buttons are drawn anew where the cycle tells something new: click none that is about to go.
    seen(person, f"Number(document.getElementById('clock').dataset.time) > {time - 0.5!r}")
    return person


def seen(tab: Tab, condition: str) -> Any:
    """Wait until a condition holds in the page; what it gives."""
    return tab.run(SEEN.format(condition=condition, words=json.dumps(condition)))


def has(tab: Tab, where: str, words: str) -> None:
    """Wait until an element has a text in it that can be seen."""
    element = f"document.querySelector({json.dumps(where)})"
    seen(tab, f"{element}.checkVisibility() && {element}.innerText.toLowerCase().includes({json.dumps(words.lower())})")


def click(tab: Tab, where: str, words: str = "") -> None:
    """Click a button."""
    buttons = f"[...document.querySelectorAll({json.dumps(where + ' button')})]"
    seen(tab, f"{buttons}.some((b) => !b.disabled && b.textContent.endsWith({json.dumps(words)}))")
    tab.run(f"{buttons}.find((b) => !b.disabled && b.textContent.endsWith({json.dumps(words)})).click()")


def asked(shown: Shown) -> tuple[str, Action, str]:
    """The request that has arrived."""
    end = time.monotonic() + 30
    while not (found := shown.inbox.take()):
        assert time.monotonic() < end, "no request arrived"
        time.sleep(0.02)
    (request,) = found
    return request.person, request.action, request.about


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        (Mode.OFF, "reads nothing"),
        (Mode.MONITOR, "estimates only"),
        (Mode.ADVISORY, "pi advises"),
        (Mode.CLOSED, "pi with rpem"),
        (Mode.SHED, "given back to the plant"),
    ],
)
def test_every_mode_is_seen(tab: Tab, shown: Shown, mode: Mode, words: str) -> None:
    shown.show(mode=mode)
    has(tab, "#tile-decides", mode.name)
    has(tab, "#tile-decides", words)


@pytest.mark.parametrize("position", ["off", "monitor", "advisory", "closed"])
def test_every_mode_is_asked_for_and_closed_only_at_the_second_click(tab: Tab, shown: Shown, position: str) -> None:
    click(tab, "#positions", position)
    if position == "closed":
        has(tab, "#positions", "Sure? closed")
        assert shown.inbox.take() == []
        click(tab, "#positions", position)
    assert asked(shown) == ("A. Person", Action.SWITCH, position)
    shown.show(allowed=Mode[position.upper()])
    seen(tab, f"document.querySelector('[data-position={position}]').getAttribute('aria-pressed') === 'true'")


@pytest.mark.parametrize("check", [c for c in Check if c not in (Check.OK, Check.OLD, Check.ABSENT)])
def test_every_fault_of_an_analyser_is_seen(tab: Tab, shown: Shown, check: Check) -> None:
    alarm = Alarm("tag concentrate_grade", f"concentrate grade: {check.value}", 100.0)
    shown.show(checks={**shown.last.outcome.checks, "concentrate_grade": check}, alarms={alarm.key: alarm})
    has(tab, "#strips .inside", check.value)
    has(tab, "#alarms .active.new", check.value)


@pytest.mark.parametrize(
    "words",
    [
        "no new sample from the plant",
        "a value that a move needs is missing",
        "no estimate, or no valid decision",
        "the cycle before took too long",
        "a write was refused or read back differently",
        "the operator's switch can not be read",
    ],
)
def test_every_fault_of_a_cycle_is_seen_and_acknowledged(tab: Tab, shown: Shown, words: str) -> None:
    alarm = Alarm(words, words, 100.0)
    shown.show(faults=(words,), alarms={words: alarm})
    has(tab, "#tile-link", words)
    has(tab, "#alarms .active.new", words)
    click(tab, "#alarms", "Acknowledge")
    assert asked(shown) == ("A. Person", Action.ACKNOWLEDGE, words)
    shown.show(alarms={words: replace(alarm, acknowledged="A. Person", active=False)})
    has(tab, "#alarms .gone", "seen by A. Person")


def test_a_lost_link_and_one_that_tells_nothing_are_seen(tab: Tab, shown: Shown) -> None:
    shown.show(connected=False, alive=False)
    has(tab, "#tile-link", "no connection")
    shown.show(alive=False)
    has(tab, "#tile-link", "silent")


@pytest.mark.parametrize("status", [Status.SHIFTED_PLAN, Status.HELD, Status.SAFE_INPUT])
def test_a_solver_that_fails_is_seen(tab: Tab, shown: Shown, status: Status) -> None:
    shown.show(decision=Decision(shown.last.outcome.sample.inputs, status, "pi"))  # type: ignore[union-attr]
    has(tab, "#tile-solve.bad", status.value)


def test_a_limit_that_is_left_and_a_grade_that_is_not_measured_are_seen(tab: Tab, shown: Shown) -> None:
    alarm = Alarm("limit concentrate_grade", "concentrate grade is below its limit of 20 %", 100.0)
    shown.show(alarms={alarm.key: alarm})
    has(tab, "#tile-grade.bad", "limit")
    sample = shown.last.outcome.sample
    assert sample is not None
    nothing = replace(sample, outputs=np.full_like(sample.outputs, math.nan))
    now = shown.last
    shown.server.show(replace(now, outcome=replace(now.outcome, sample=nothing)))
    has(tab, "#tile-grade.held", "predicted, not measured")


def test_the_card_shows_evidence_as_text_and_takes_each_step(tab: Tab, shown: Shown) -> None:
    def stage(which: Stage, by: str = "") -> None:
        card = Card(FINDING, 120.0, which, by, (("concentrate_grade", 2e-3, 1e-3),))
        shown.show(card=card, extended=which is Stage.APPLIED)

    stage(Stage.FOUND)
    has(tab, "#found", "since 14:05 froth recovery is 20 % lower <script>")
    tab.run("document.querySelector('#found details').open = true")
    has(tab, "#found", "<img src=x")
    assert not tab.run("document.querySelectorAll('#found img, #found script').length")
    assert "broken" not in tab.run("document.title")
    click(tab, "#found", "Acknowledge")
    assert asked(shown) == ("A. Person", Action.ACKNOWLEDGE, "discovery")
    click(tab, "#found", "Try in shadow")
    assert asked(shown) == ("A. Person", Action.SHADOW, "")
    for which, words, action in ((Stage.SHADOW, "Apply", Action.APPLY), (Stage.APPLIED, "Revert", Action.REVERT)):
        stage(which, "B. Other")
        has(tab, "#found .stage", f"{which.value} by B. Other")
        click(tab, "#found", words)
        assert shown.inbox.take() == [], "at the second click only"
        click(tab, "#found", words)
        assert asked(shown) == ("A. Person", action, "")


def test_shadows_and_what_persons_did_are_seen(tab: Tab, shown: Shown) -> None:
    compared = Compared(300, (("concentrate_grade", 2e-3, 1.5e-3),))
    plan = ShadowPlan("other", "rpem", "pi")
    failed = ShadowView(replace(plan, role="failed"), "ended: ValueError: it failed", 3, None, compared)
    done = Answered(Request("A. Person", Action.SWITCH, "off"), "the page's switch is at off")
    shown.show(shadows={"other": ShadowView(plan, "ok", 0, None, compared), "failed": failed}, answered=(done,))
    has(tab, "#shadows [data-role=other]", "rpem and pi")
    has(tab, "#shadows .ended", "ValueError: it failed")
    has(tab, "#answers", "A. Person: switch off")


def test_the_plan_is_drawn_behind_now_and_the_newest_value_at_it(tab: Tab, shown: Shown) -> None:
    sample = shown.last.outcome.sample
    assert sample is not None
    ahead = sample.time + 60.0 * np.arange(1, 6, dtype=np.float64)
    expected = Plan(ahead, {"air_flow": np.full(5, 1.6e-3)}, {"concentrate_grade": np.full(5, 0.23)})
    cycle = shown.show(decision=Decision(sample.inputs, Status.OK, "pi", plan=expected))
    seen(tab, f"Number(document.querySelector('#over-time').dataset.newest) >= {cycle.snapshot.time}")
    x, measured, planned = tab.run(
        "(() => { const p = AdaptiveFlotChart.charts[0].plots[0]; return [p.data[0], p.data[1], p.data.at(-1)]; })()"
    )
    now = len(x) - 6
    assert x[now] == pytest.approx(cycle.snapshot.time) and x[-1] == pytest.approx(cycle.snapshot.time + 300)
    assert measured[now] == pytest.approx(100 * sample.outputs[0], rel=1e-5) and measured[now + 1 :] == [None] * 5
    assert planned[now + 1 :] == [23.0] * 5 and planned[: now - 1] == [None] * (now - 1)


def test_a_page_without_news_says_so(tab: Tab, shown: Shown) -> None:
    seen(tab, "!document.querySelector('#lost').hidden && document.body.classList.contains('stale')")
    shown.show()
    seen(tab, "document.querySelector('#lost').hidden && !document.body.classList.contains('stale')")


def test_who_may_only_look_has_no_button_that_acts(browser: Browser, shown: Shown) -> None:
    tab = visit(browser, shown, VIEW)
    shown.show(card=Card(FINDING, 120.0), alarms={"a": Alarm("a", "something", 1.0)})
    has(tab, "#found", "froth recovery")
    assert (
        tab.run(
            "[...document.querySelectorAll('#positions button, main button:not(.name)')]"
            ".filter((b) => !b.disabled && !b.closest('.chart')).length"
        )
        == 0
    )
    tab.close()


def test_a_page_of_a_link_that_has_never_seen_its_plant_says_so(browser: Browser, shown: Shown) -> None:
    link, last = shown.server.hub._pictures.link, shown.last
    cut_off = replace(last.outcome, mode=Mode.MONITOR, sample=None, estimate=None, decision=None, checks={}, acting={})
    never = replace(last, snapshot=NOTHING, outcome=cut_off, connected=False)
    with served(link) as (server, inbox):
        tab = opened(browser, apart=True)
        log_in(browser, tab, server, ACT)
        server.show(never)
        has(tab, "#clock", "The plant has told nothing yet")
        has(tab, "#tile-link", "lost")
        server.show(last)
        seen(
            tab, "document.querySelector('#over-time').dataset.newest && document.querySelector('#clock').dataset.time"
        )
        assert errors(tab) == [] and server.problem == "" and not inbox.take()
        tab.close()


def test_an_extended_model_in_use_is_told_and_can_be_reverted_where_its_card_is_gone(tab: Tab, shown: Shown) -> None:
    extended = shown.last.model.with_effects((EFFECT,))
    estimate = shown.last.outcome.estimate
    assert estimate is not None
    rest = np.zeros(len(extended.states) - len(estimate.state))
    shown.show(model=extended, extended=True, estimate=replace(estimate, state=np.concatenate([estimate.state, rest])))
    has(tab, "#found .in-use", "The model in use is extended: bubble size by air flow.")
    seen(tab, "[...document.querySelectorAll('#found button')].some((b) => b.textContent === 'Revert' && !b.disabled)")
    shown.show()
    seen(tab, "!document.querySelector('#found .in-use')")


WIDE = "[...document.querySelectorAll('.tile .value')].filter((v) => v.scrollWidth > v.clientWidth + 1)"
"""Values at the top that run into the next one: their boxes hide nothing."""


@pytest.mark.parametrize("width", [*WIDTHS, 1920, 1121, 641])
def test_every_value_at_the_top_fits_its_place_and_can_be_read_from_two_metres(
    tab: Tab, shown: Shown, width: int
) -> None:
    tab.look(width, 900, dark=False)
    for mode in Mode:
        shown.show(mode=mode, connected=mode is not Mode.OFF)
        seen(tab, f"document.body.dataset.mode === '{mode.name.lower()}'")
        for money in (8.25, 123.4, 54321.0):
            tab.run(f"AdaptiveFlotHead.money({money})")
            assert tab.run(f"{WIDE}.map((v) => v.textContent)") == [], (mode, money)
    size = tab.run("parseFloat(getComputedStyle(document.querySelector('#tile-grade .value')).fontSize)")
    assert width < 900 or size >= 48, "capitals 16 minutes of arc high at two metres (ISO 9241-303), at 96 dpi"
    tab.look(1400, 900, dark=False)


def test_it_is_whole_at_every_width_and_needs_nothing_from_elsewhere(
    browser: Browser, shown: Shown, tmp_path: Path
) -> None:
    tab = visit(browser, shown, ACT)
    wrong = {k: Alarm(k, f"{k} is wrong in some way that needs words", 100.0) for k in ("solver", "tag level")}
    for width in WIDTHS:
        for dark in (False, True):
            tab.look(width, 900, dark)
            shown.show(card=Card(FINDING, 120.0), alarms=wrong, mode=Mode.SHED)
            tab.run(SETTLED)
            assert tab.run("pageProblems()") == [], (width, dark)
    assert errors(tab) == []
    urls = {e["params"]["request"]["url"] for e in tab.events("Network.requestWillBeSent")}
    assert all(url.startswith(shown.server.address) for url in urls)
    size = tab.run("fetch('/assets/page.js').then((a) => a.blob()).then((b) => b.size)")
    assert 0 < size <= LARGEST_SCRIPTS
    tab.close()
