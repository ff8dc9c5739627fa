"""A map tells the cell under the pointer, marks its row and column, and is sorted by its headings."""

from __future__ import annotations

from pathlib import Path

from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.heat import Cell, HeatMap
from adaptive_flot.report.kit.page import Page, made_by, render
from tests.browser.chromium import Browser
from tests.browser.conftest import Check
from tests.browser.pages import opened

ROWS = (
    ("froth", [Cell("7.5", "froth by air: 7.5 %", "#440154", "#ffffff"), Cell("")]),
    ("tails", [Cell("100", "tails by air: <100> %", "#fde725", "#000000", framed=True), Cell("3", "tails by time")]),
)


def written(folder: Path) -> Path:
    album = Album()
    picture = album.heat(HeatMap("site", ["air flow", "time"], ROWS), "A map.", "A map of two sites")
    page = Page("Test", "A map", "", ["An answer."], [], [picture], [], made_by(""))
    (folder / "page.html").write_text(render(page, album), encoding="utf-8")
    return folder / "page.html"


def test_the_cell_under_the_pointer_is_told(browser: Browser, tmp_path: Path) -> None:
    tab = opened(browser)
    tab.load(written(tmp_path))
    over = "dispatchEvent(new PointerEvent('pointerover', {bubbles: true}))"
    told = "document.querySelector('.told').textContent"
    marked = "[...document.querySelectorAll('.heat th.at')].map((one) => one.textContent)"
    tab.run(f"document.querySelectorAll('.heat td')[2].{over}")
    assert (tab.run(told), tab.run(marked)) == ("tails by air: <100> %", ["air flow", "tails"])
    tab.run(f"document.querySelectorAll('.heat td')[1].{over}")  # an empty cell tells nothing
    assert tab.run(marked) == []
    names = "[...document.querySelectorAll('.heat tbody th')].map((one) => one.textContent)"
    for order in (["froth", "tails"], ["tails", "froth"]):
        tab.run("document.querySelectorAll('.heat thead th')[1].click()")
        assert tab.run(names) == order
    tab.close()


def test_a_map_is_right_at_every_width(tmp_path: Path, right: Check) -> None:
    right(written(tmp_path))
