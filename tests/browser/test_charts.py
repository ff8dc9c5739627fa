"""What a reader does with a page: zoom, look up a value, hide a line, sort, go dark; and a page that grows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.charts.plotdata import Chart, Mark, Panel, Role, Strip, Trace
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Fact, Section, Table, Text
from tests.browser.chromium import Browser, Tab
from tests.browser.pages import DRAW_ALL, SETTLED, errors, is_dark, opened

TIME = np.arange(1.0, 1001.0)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with two charts over time, one of them folded, one over lags, and a table."""
    album = Album()
    lines = (Trace("truth", TIME, TIME, Role.TRUTH), Trace("rpem", TIME, 2 * TIME, Role.ESTIMATE, std=np.ones(1000)))
    strip = Strip("decided by", TIME, ["mpc"] * 600 + ["hold"] * 400, "mpc")
    first = album.chart(Chart((Panel("one", "-", lines), Panel("two", "-", lines)), (strip,)), "c", "a")
    later = (Trace("truth", 500 + TIME, TIME, Role.TRUTH),)
    other = album.chart(Chart((Panel("three", "-", later),), marks=(Mark(600.0, "alarm"),)), "c", "a")
    lags = album.chart(Chart((Panel("four", "-", lines),), x_label="lag", x_unit="samples"), "c", "a")
    table = Table("t", ("Who", "Fit [%]"), (("b", "9.5"), ("a", "−1.0"), ("c", "–"), ("d", "1 200")))
    made = Page(
        kind="Test",
        title="A page",
        lead="of a test",
        answer=["An answer."],
        facts=[Fact("Value", "1")],
        first=[first, table],
        sections=[Section("more", "More", "inside", [other, lags])],
        made=made_by("adaptive-flot test"),
    )
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(render(made, album), encoding="utf-8")
    return path


@pytest.fixture
def tab(browser: Browser, page: Path) -> Tab:
    """The page, open."""
    found = opened(browser)
    found.look(1200, 900, dark=False)
    found.load(page)
    found.run(SETTLED)
    return found


def ranges(tab: Tab) -> list[list[float]]:
    """Range of the horizontal axis of each panel that is drawn."""
    shown = "AdaptiveFlotChart.charts.flatMap((c) => c.plots.map((p) => [p.scales.x.min, p.scales.x.max]))"
    found: list[list[float]] = tab.run(shown)
    return found


def drag(tab: Tab, start: float, end: float) -> None:
    """Drag over the first panel from one share of its width to another."""
    x, y, width = tab.run(
        "(() => { const b = document.querySelector('.u-over').getBoundingClientRect();"
        " return [b.x, b.y + b.height / 2, b.width]; })()"
    )
    at = {"y": y, "button": "left", "clickCount": 1}
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + start * width, y=y)
    tab.call("Input.dispatchMouseEvent", type="mousePressed", x=x + start * width, **at)
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + end * width, buttons=1, **at)
    tab.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + end * width, **at)
    tab.run(SETTLED)


def test_a_folded_chart_is_drawn_when_it_is_unfolded(tab: Tab) -> None:
    assert len(ranges(tab)) == 3, "two panels and the strips of the first chart"
    tab.run(DRAW_ALL)
    assert ranges(tab) == [[0, 1000]] * 3 + [[500, 1500], [1, 1000]]


def test_a_zoom_is_that_of_all_time_axes_and_of_no_other(tab: Tab) -> None:
    drag(tab, 0.25, 0.75)
    tab.run(DRAW_ALL)  # a chart that is drawn later shows the same stretch
    *over_time, lag = ranges(tab)
    assert len(over_time) == 4 and len({tuple(r) for r in over_time}) == 1
    assert over_time[0] == pytest.approx([250, 750], abs=10)
    assert lag == [1, 1000]
    tab.run("document.querySelector('.chart-tools button:last-child').click()")
    assert ranges(tab) == [[0, 1000]] * 3 + [[500, 1500], [1, 1000]], "each shows all of its own"
    assert errors(tab) == []


def test_the_pointer_tells_every_value_at_its_time(tab: Tab) -> None:
    drag(tab, 0.1, 0.9)
    tab.run("document.querySelector('.chart-tools button:last-child').click()")
    box = tab.run(
        "(() => { const b = document.querySelector('.u-over').getBoundingClientRect(); return [b.x, b.y, b.width]; })()"
    )
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=box[0] + 0.7 * box[2], y=box[1] + 20)
    tab.run(SETTLED)
    tips = tab.run("[...document.querySelectorAll('.tip:not([hidden])')].map((tip) => tip.innerText.split(/\\s+/))")
    assert len(tips) == 3, "the panels of a chart, and its strips"
    told = dict(zip(tips[0][3::2], tips[0][4::2], strict=False))
    assert float(told["truth"]) == pytest.approx(700, abs=3) and float(told["rpem"]) == pytest.approx(1400, abs=6)
    assert tips[2][-1] == "hold"


def test_a_name_hides_its_lines_in_every_panel_of_the_chart(tab: Tab) -> None:
    shown = "AdaptiveFlotChart.charts[0].plots.slice(0, 2).map((p) => p.series.slice(1).map((s) => s.show))"
    assert tab.run(shown) == [[True] * 4] * 2, "truth, estimate, and the two edges of its band"
    tab.run("[...document.querySelectorAll('button.name')].find((b) => b.innerText === 'rpem').click()")
    assert tab.run(shown) == [[True, False, False, False]] * 2


def test_a_table_sorts_by_number_with_what_is_unknown_last(tab: Tab) -> None:
    column = "[...document.querySelectorAll('tbody tr')].map((row) => row.cells[0].innerText)"
    for expected in (["a", "b", "d", "c"], ["d", "b", "a", "c"]):
        tab.run("document.querySelectorAll('thead th')[1].click()")
        assert tab.run(column) == expected


def test_dark_by_the_system_and_by_the_switch(tab: Tab) -> None:
    for system in (False, True):
        tab.look(1200, 900, dark=system)
        assert is_dark(tab) == system
        tab.run("document.getElementById('theme').click()")
        assert is_dark(tab) != system
        tab.run("document.getElementById('theme').click()")
    line = "AdaptiveFlotChart.parts.colour('truth')"
    assert tab.run(line) == "#f2f2f2"


def test_the_list_of_contents_opens_a_chapter(tab: Tab) -> None:
    assert not tab.run("document.getElementById('more').open")
    tab.run("document.querySelector('a[href=\"#more\"]').click()")
    tab.run(SETTLED)
    assert tab.run("document.getElementById('more').open")


def test_without_scripts_there_is_a_picture_of_each_chart(browser: Browser, page: Path) -> None:
    tab = browser.open()
    tab.call("Emulation.setScriptExecutionDisabled", value=True)
    tab.look(1200, 900, dark=False)
    tab.load(page)
    document = tab.call("DOM.getDocument")["root"]["nodeId"]
    pictures = tab.call("DOM.querySelectorAll", nodeId=document, selector=".chart img")["nodeIds"]
    assert len(pictures) == 3
    box = tab.call("DOM.getBoxModel", nodeId=pictures[0])["model"]
    assert box["width"] > 400 and box["height"] > 200


def test_print_shows_all_chapters_and_crops_nothing(tab: Tab) -> None:
    """On paper of 190 mm every part lies within it, folded chapters are open, and all charts are drawn."""
    tab.run("dispatchEvent(new Event('beforeprint'))")
    tab.call("Emulation.setEmulatedMedia", media="print")
    tab.look(718, 1000, dark=True)
    tab.call("Emulation.setEmulatedMedia", media="print")
    tab.run(SETTLED)
    assert tab.run("document.getElementById('more').open") and len(ranges(tab)) == 5
    wide = tab.run("Math.max(...[...document.querySelectorAll('main *')].map((e) => e.getBoundingClientRect().right))")
    assert wide <= 718 and not is_dark(tab)
    tab.run("dispatchEvent(new Event('afterprint'))")
    assert not tab.run("document.getElementById('more').open")


def test_a_chart_grows_and_follows_the_newest_values(tab: Tab) -> None:
    """What a live page does: points are added at the end, a line without one has a gap, and the axis goes along."""
    grown = tab.run(
        "(() => { const chart = AdaptiveFlotChart.charts[0];"
        " chart.append(0, [1001, 1002], [[7, 8], [null, 9], [null, null], [null, null]]);"
        " const p = chart.plots[0];"
        " return [p.data[0].slice(-2), p.data[1].slice(-2), p.data[2].slice(-2), p.scales.x.max]; })()"
    )
    assert grown == [[1001, 1002], [7, 8], [None, 9], 1002]
    assert errors(tab) == []


def test_one_chapter_is_open_at_a_time_and_stays_in_sight(browser: Browser, tmp_path: Path) -> None:
    """A chapter within another one does not close that."""
    tall = [Text("word " * 3000)]
    chapters = [Section(f"in-{k}", f"In {k}", "", tall) for k in range(2)]
    sections = [Section("one", "One", "", tall), Section("two", "Two", "", [], chapters)]
    made = Page("Test", "Chapters", "", ["An answer."], [], [], sections, made_by(""))
    (tmp_path / "page.html").write_text(render(made, Album()), encoding="utf-8")
    tab = opened(browser)
    tab.look(1200, 900, dark=False)
    tab.load(tmp_path / "page.html")
    opens = "[...document.querySelectorAll('details.fold[open]')].map((fold) => fold.id)"
    for anchor, expected in (("one", ["one"]), ("two", ["two"]), ("in-0", ["two", "in-0"]), ("in-1", ["two", "in-1"])):
        tab.run(f"document.querySelector('#{anchor} > summary').click(); {SETTLED}")
        assert tab.run(opens) == expected
        top = tab.run(f"document.getElementById('{anchor}').getBoundingClientRect().top")
        assert -1 <= top < 900
    tab.run("dispatchEvent(new Event('beforeprint'))")
    assert len(tab.run(opens)) == 4
    tab.run("dispatchEvent(new Event('afterprint'))")
    tab.run(f"document.querySelector('#one > summary').click(); {SETTLED}")
    assert "two" not in tab.run(opens)
    tab.close()
