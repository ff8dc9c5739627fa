"""The page in a real Chromium: from a change at the OPC UA source to the drawn value."""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from asyncua import ua

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.live.certificates import token_file
from adaptive_flot.live.link_file import Link, load_link
from adaptive_flot.live.loop import quiet_libraries, settle
from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.live.plant.operator import Operator
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.plant.server import PlantServer, ServerPlace
from adaptive_flot.live.plant.tags import Tag
from adaptive_flot.live.requests import Inbox
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.running.run import LinkRun
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from tests.browser.chromium import Browser, Tab, found

WATCHED = "concentrate_grade"
WATCH = """
    window.drawn = { value: [], chart: [] };
    const painted = (what, time) => requestAnimationFrame(() => requestAnimationFrame(() =>
      drawn[what].push([Number(time), performance.timeOrigin + performance.now()])));
    const clock = document.querySelector('#clock'), chart = document.querySelector('#over-time');
    new MutationObserver(() => painted('value', clock.dataset.time)).observe(clock, { attributes: true });
    new MutationObserver(() => painted('chart', chart.dataset.newest)).observe(chart, { attributes: true });
"""


def play(connection: Connection, certificates: Path, port: int, scenario: str, hours: float, speed: float) -> None:
    """A test plant in a process of its own, which tells when each value of the watched tag was published."""
    quiet_libraries()
    loaded = load_scenario(scenario)
    file = loaded.file.model_copy(update={"duration_s": round(3600 * hours / loaded.dt) * loaded.dt})

    def note(tag: Tag, value: ua.DataValue, row: int) -> ua.DataValue:
        if tag.name == WATCHED:
            connection.send((value.SourceTimestamp.timestamp(), time.time()))
        return value

    async def run() -> None:
        plant = TestPlant(Realisation(replace(loaded, file=file), 1))
        server = PlantServer(plant, ServerPlace(certificates, port=port), note)
        server.operator = Operator()
        await server.start()
        connection.send(None)
        await server.run(speed)

    asyncio.run(run())


def page_link(folder: Path, scenario: str, port: int, speed: float, hours: float) -> Link:
    """A link with a page on a free port, to a scenario that is so long [h]."""
    url = f"opc.tcp://127.0.0.1:{port}/adaptive-flot"
    text = link_text(load_scenario(scenario), url, folder / "certificates", speed=speed, page=0)
    content = {**yaml.safe_load(text), "database": f"sqlite:///page-{time.monotonic_ns()}.sqlite"}
    (folder / "page.yaml").write_text(yaml.safe_dump(content))
    link = load_link(folder / "page.yaml")
    rows = round(3600 * hours / link.scenario.dt)
    file = link.scenario.file.model_copy(update={"duration_s": rows * link.scenario.dt})
    return link.model_copy(update={"scenario": replace(link.scenario, file=file)})


@contextmanager
def opened(page: PageServer, folder: Path) -> Iterator[Tab]:
    """The page in Chromium, logged in for acting."""
    program = found()
    if program is None:
        raise AdaptiveFlotError("no Chromium on this system: the page can not be measured")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, Path(profile))
        tab = browser.open()
        tab.call("Network.disable")  # every message of the stream would be told here too, and kept
        tab.look(1400, 900, dark=False)
        tab.go(page.address)
        token = json.dumps(token_file(folder / "certificates", "act").read_text().strip())
        tab.run(f"document.querySelector('[name=token]').value = {token}")
        tab.run("document.querySelector('[name=name]').value = 'Bench'; document.querySelector('form').submit()")
        browser.wait_for("Page.loadEventFired", tab.session)
        try:
            yield tab
        finally:
            browser.close()


def latency_figures(folder: Path, scenario: str, speed: float, seconds: float) -> dict[str, object]:
    """From the change of a value in the plant's server to its paint, over OPC UA and with storage [ms]."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    hours = speed * (seconds + 300) / 3600 + 1
    link = page_link(folder, scenario, port, speed, hours)
    here, there = multiprocessing.Pipe(duplex=False)
    context = multiprocessing.get_context("spawn")
    arguments = (there, folder / "certificates", port, scenario, hours, speed)
    plant = context.Process(target=play, args=arguments, daemon=True)
    plant.start()
    there.close()
    here.recv()
    published: dict[float, float] = {}
    threading.Thread(target=_note, args=(here, published), daemon=True).start()
    cycles: list[tuple[Mode, float]] = []
    inbox = Inbox()
    page = PageServer(link, inbox)
    page.start()
    stop: list[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = []

    def show(progress: Progress) -> None:
        cycles.append((progress.outcome.mode, progress.seconds))
        page.show(progress)

    async def run() -> None:
        memory = Memory(open_database(link.file.database, folder), link)
        event = asyncio.Event()
        stop.append((asyncio.get_running_loop(), event))
        linked_run = LinkRun(link, memory, show, inbox)
        settle()
        await linked_run.run(event)
        memory.close()

    linked = threading.Thread(target=lambda: asyncio.run(run()))
    linked.start()
    try:
        with opened(page, folder) as tab:
            while not cycles or cycles[-1][0] is not Mode.CLOSED:
                time.sleep(0.2)
            tab.run(WATCH)
            del cycles[:]
            time.sleep(seconds)
            drawn = tab.run("drawn")
            size = tab.run("fetch('/assets/page.js').then((a) => a.blob()).then((b) => b.size)")
    finally:
        stop[0][0].call_soon_threadsafe(stop[0][1].set)
        linked.join()
        page.close()
        plant.kill()
        plant.join()
    name = f"page at {speed:g} times real time"
    took = 1000 * np.array([s for _, s in cycles])
    figures: dict[str, object] = {
        f"{name}: cycle with storage and page open, median and 99 % [ms]": quantiles(took, (50, 99)),
        f"{name}: cycles; not in closed": f"{len(cycles)}; {sum(mode is not Mode.CLOSED for mode, _ in cycles)}",
        "page: scripts [kB]": round(size / 1000, 1),
    }
    for what, words in (("value", "tag to pixel"), ("chart", "tag to the chart's pixel")):
        ms = np.array([at - 1000 * published[round(t, 3)] for t, at in drawn[what] if round(t, 3) in published])
        figures[f"{name}: {words}, median, 99 % and most [ms]"] = f"{quantiles(ms, (50, 99, 100))} of {len(ms)}"
    return figures


def _note(connection: Connection, published: dict[float, float]) -> None:
    """Take down what the plant's process tells: source time, and when it was published."""
    while True:
        try:
            source, at = connection.recv()
        except (EOFError, OSError):
            return
        published[round(source, 3)] = at


def quantiles(values: Any, percent: tuple[int, ...]) -> str:
    """Percentiles in words."""
    if not len(values):
        return "none"
    *others, last = (f"{q:.1f}" for q in np.percentile(values, percent))
    return f"{', '.join(others)} and {last}"
