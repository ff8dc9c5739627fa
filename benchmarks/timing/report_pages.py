"""How soon a reader sees the first chart of a page, and how large pages are.

Command: `python -m benchmarks.timing.report_pages`.

Needs Chromium. With names of pages (HTML) it measures those too.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from tests.browser.chromium import Browser, Tab, found

ROWS = 100_000
REPEATS = 5
WIDTHS = (1400, 900, 390)
HOOK = """
new MutationObserver((seen, observer) => {
  if (!document.querySelector('.uplot canvas')) return;
  observer.disconnect();
  requestAnimationFrame(() => setTimeout(() => { window.firstChart = performance.now(); }));
}).observe(document, { childList: true, subtree: true });
"""


@dataclass(frozen=True)
class Measured:
    """A page: size [byte], time from the start of loading to its first chart [s] (median), and heights as it opens."""

    name: str
    size: int
    seconds: float
    heights: dict[int, int]


def long_page(lines: int, folder: Path) -> Path:
    """Write a page of one chart with some lines of `ROWS` points each."""
    album, time = Album(), np.arange(float(ROWS))
    noise = np.cumsum(np.random.default_rng(1).standard_normal((lines, ROWS)), axis=1)
    panels = tuple(
        Panel(f"quantity {i + 1}", "m3/s", (Trace("", time, y, Role.ESTIMATE),)) for i, y in enumerate(noise)
    )
    chart = album.chart(Chart(panels), f"{lines} times {ROWS} points.", "Random walks over time")
    page = Page("Benchmark", "A long record", "", ["An answer."], [], [chart], [], made_by(""))
    path = folder / f"{lines} x {ROWS} points.html"
    path.write_text(render(page, album), encoding="utf-8")
    return path


def measure(browser: Browser, page: Path) -> Measured:
    """Load a page several times, then once at each width."""
    tab = browser.open()
    tab.call("Page.addScriptToEvaluateOnNewDocument", source=HOOK)
    tab.look(WIDTHS[0], 900, dark=False)
    seconds = [_first_chart(tab, page) for _ in range(REPEATS)]
    heights = {}
    for width in WIDTHS:
        tab.look(width, 900, dark=False)
        tab.load(page)
        tab.run("new Promise((done) => setTimeout(done, 300))")
        heights[width] = int(tab.run("document.documentElement.scrollHeight"))
    tab.close()
    return Measured(page.stem, page.stat().st_size, median(seconds), heights)


def _first_chart(tab: Tab, page: Path) -> float:
    tab.load(page)
    for _ in range(200):
        at = tab.run("new Promise((done) => setTimeout(() => done(window.firstChart ?? null), 10))")
        if at is not None:
            return float(at) / 1000
    return float("nan")


def pages(folder: Path) -> Iterator[Path]:
    """Pages that are made here, then those that were named."""
    for lines in (1, 8):
        yield long_page(lines, folder)
    yield from map(Path, sys.argv[1:])


def main() -> None:
    """Measure and print."""
    program = found()
    if program is None:
        sys.exit("no Chromium on this system; `make browser` installs it where it may")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        browser = Browser(program, folder / "profile")
        print("page; size [kB]; first chart after [s]; heights as it opens [px] at 1400, 900, 390 px")
        for page in pages(folder):
            m = measure(browser, page)
            heights = ", ".join(map(str, m.heights.values()))
            print(f"{m.name}; {m.size / 1000:.0f}; {m.seconds:.2f}; {heights}")
        browser.close()


if __name__ == "__main__":
    main()
