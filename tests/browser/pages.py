"""Open a page in a browser as readers do, and say what is wrong with it."""

from __future__ import annotations

from pathlib import Path

from tests.browser.chromium import Browser, Tab

WIDTHS = (1400, 900, 390)
"""Widths of the window [px]."""
TALLEST = 6000
"""Height of a page [px], as it opens and with any one of its chapters unfolded."""
LARGEST = 2_000_000
"""Size of a page [bytes]."""
CHECKS = Path(__file__).with_name("checks.js").read_text(encoding="utf-8")
SETTLED = """
    new Promise((done) => {
      const wait = (frames) => requestAnimationFrame(() => (frames ? wait(frames - 1) : setTimeout(done)));
      wait(4);
    })
"""
"""Four frames on: what observers of sizes and of places on the screen have to do is done by then, however slow."""
OPENED = """
    (() => {
      const folds = [...document.querySelectorAll('details.fold')];
      return folds.map((fold) => {
        folds.forEach((other) => other.open = false);
        for (let at = fold; at; at = at.parentElement) if (at.tagName === 'DETAILS') at.open = true;
        return [fold.id, document.documentElement.scrollHeight];
      });
    })()
"""
"""Of each chapter: its name, and the height of the page with it open and no other one beside it."""
DRAW_ALL = f"""
    document.querySelectorAll('details').forEach((part) => {{ part.name = ''; part.open = true; }});
    if (typeof AdaptiveFlotChart !== 'undefined') AdaptiveFlotChart.all();
    {SETTLED}
"""


def opened(browser: Browser, apart: bool = False) -> Tab:
    """Return a new tab in which text that is drawn is written down; `apart` has cookies of its own."""
    tab = browser.open(apart)
    tab.call("Page.addScriptToEvaluateOnNewDocument", source=CHECKS)
    return tab


def problems(browser: Browser, page: Path) -> list[str]:
    """What is wrong with a page at each width, light and dark; nothing where it is right."""
    tab = opened(browser)
    found = [f"{page.stat().st_size} bytes"] if page.stat().st_size > LARGEST else []
    for width in WIDTHS:
        tab.look(width, 900, dark=False)
        tab.load(page)
        tab.run(SETTLED)
        height = tab.run("document.documentElement.scrollHeight")
        found += [f"{width} px wide: {height} px tall"] if height > TALLEST else []
        for dark in (False, True):
            tab.look(width, 900, dark)
            tab.run(DRAW_ALL)
            where = f"{width} px wide, {'dark' if dark else 'light'}"
            found += [f"{where}: {problem}" for problem in tab.run("pageProblems()")]
            if is_dark(tab) != dark:
                found.append(f"{where}: the paper has the wrong colour")
        tall = [(name, height) for name, height in tab.run(OPENED) if height > TALLEST]
        found += [f"{width} px wide: {height} px tall with {name} open" for name, height in tall]
    found += errors(tab)
    found += fetched(tab, page)
    tab.close()
    return found


def is_dark(tab: Tab) -> bool:
    """Whether the paper is darker than the ink."""
    paper, ink = tab.run(
        "['backgroundColor', 'color'].map((what) => getComputedStyle(document.body)[what].match(/\\d+/g)"
        ".slice(0, 3).reduce((sum, part) => sum + Number(part), 0))"
    )
    return bool(paper < ink)


def errors(tab: Tab) -> list[str]:
    """Errors of scripts, and what the browser complains about."""
    found = []
    for event in tab.events("Runtime.exceptionThrown", "Log.entryAdded"):
        entry = event["params"].get("exceptionDetails") or event["params"]["entry"]
        text = entry.get("exception", {}).get("description") or entry.get("text", "")
        if entry.get("level", "error") == "error":
            found.append(f"script: {text}")
    return found


def fetched(tab: Tab, page: Path) -> list[str]:
    """Whatever the page asked for but itself."""
    urls = [e["params"]["request"]["url"] for e in tab.events("Network.requestWillBeSent")]
    own = page.resolve().as_uri()
    return [f"network: {url[:80]}" for url in urls if not url.startswith(("data:", own))]
