"""The checks of pages find what they are for: each page here has one fault, and a page without any passes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import pages
from tests.browser.chromium import Browser

HEAD = """<!doctype html><html><head><meta name="viewport" content="width=device-width"><style>
:root { color-scheme: light dark; } body { background: Canvas; color: CanvasText; }
</style></head><body>"""
CANVAS = """<canvas width="200" height="50"></canvas><script>
const g = document.querySelector("canvas").getContext("2d");
g.clearRect(0, 0, 200, 50); g.font = "12px sans-serif"; g.fillRect(0, 0, 5, 5);
"""

FAULTS = {
    "cut off by its box": "<div style='width: 3em; overflow: hidden; white-space: nowrap'>a long line of words</div>",
    "wider than the window": "<div style='width: 1500px'>wide</div>",
    "script: ReferenceError": "<script>nowhere();</script>",
    "network: http://127.0.0.1:9/": "<img alt='' src='http://127.0.0.1:9/picture.png'>",
    "cut off at the edge": CANVAS + "g.fillText('3000', 190, 20);</script>",
    "overlap": CANVAS + "g.fillText('3000', 50, 20); g.fillText('3600', 60, 20);</script>",
    "nothing is drawn": CANVAS.replace("g.fillRect(0, 0, 5, 5);", "") + "</script>",
    "px tall": "<div style='height: 7000px'>tall</div>",
    "wrong colour": "<style>body { background: white !important; color: black !important; }</style>",
}


@pytest.mark.parametrize("told", FAULTS)
def test_a_fault_is_found(told: str, browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(HEAD + FAULTS[told])
    assert any(told in problem for problem in pages.problems(browser, page))


def test_a_right_page_passes(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(HEAD + "<p>words</p>" + CANVAS + "g.fillText('3000', 50, 20);</script>")
    assert pages.problems(browser, page) == []
