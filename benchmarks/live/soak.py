"""Simulated hours with the page open in a real Chromium: memory and times of cycles."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from adaptive_flot.live.page.server import PageServer
from adaptive_flot.live.plant.direct import DirectPlant
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.requests import Inbox
from adaptive_flot.live.running.desk import Desk
from adaptive_flot.live.running.model_use import ModelUse
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store.beside import Beside
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.runner.scenario.realisation import Realisation
from benchmarks.live.lockstep import resident_mb
from benchmarks.live.page import opened, page_link, quantiles
from tests.browser.chromium import Tab

WARM = 4000
"""Simulated cycles before memory is taken as the start: the page's last hour is full then."""


def soak_figures(
    folder: Path, scenario: str, hours: float, say: Callable[[str], None] = lambda words: None
) -> dict[str, object]:
    """Simulated hours as fast as they go, without the network, page and browser open: memory and times of cycles."""
    link = page_link(folder, scenario, 4840, 1.0, hours + 0.1)
    inbox = Inbox()
    page = PageServer(link, inbox)
    page.start()
    memory = Memory(open_database(link.file.database, folder), link)
    use = ModelUse(link)
    desk = Desk(link, use)
    direct = DirectPlant(TestPlant(Realisation(link.scenario, 1)))
    direct.operate("switch", Mode.MONITOR)
    state = use.cycle.start()
    cycles = round(3600 * hours / link.scenario.dt)
    took, used = np.zeros(cycles), np.zeros(cycles)
    loads: list[float] = []
    grown = {"process": 0.0, "browser": 0.0}
    modes: dict[str, int] = {}
    with opened(page, folder) as tab:
        for k in range(cycles):
            if k == WARM or k == cycles - 1:
                sign = 1.0 if k > WARM else -1.0
                grown["process"] += sign * resident_mb()
                grown["browser"] += sign * _heap_mb(tab)
            if k % WARM == 0:
                loads.append(os.getloadavg()[0])
                say(f"{k} of {cycles} cycles: {resident_mb():.1f} MB, browser {_heap_mb(tab):.1f} MB")
            direct.interval()
            snapshot = direct.snapshot()
            begin, before = time.perf_counter(), time.thread_time()
            answered = desk.answer(inbox.take())
            state, outcome = use.cycle.step(state, replace(snapshot, allowed=desk.allowed))
            desk.after(outcome, state.estimation.began, None)
            beside = Beside(answered, desk.said(), desk.results())
            memory.store(snapshot, outcome, state.estimation.began, {}, beside=beside)
            took[k], used[k] = time.perf_counter() - begin, time.thread_time() - before
            direct.take(outcome)
            if state.estimation.estimate is not None:
                direct.operate("switch", Mode.CLOSED)
            shown = desk.alarms, desk.card, desk.shadows(), answered
            page.show(
                Progress(snapshot, outcome, took[k], "", True, state.modes, state.histories, use.cycle.model, *shown)
            )
            mode = outcome.mode.name.lower()
            modes[mode] = modes.get(mode, 0) + 1
        newest = tab.run("document.querySelector('#clock').textContent")
    page.close()
    memory.close()
    name = f"{hours:g} simulated hours with the page open"
    return {
        f"{name}: cycles by mode": modes,
        f"{name}: memory growth of the link after the first {WARM} cycles [MB]": round(grown["process"], 1),
        f"{name}: growth of the page's scripts in the browser [MB]": round(grown["browser"], 1),
        f"{name}: cycle with storage, median and 99 % [ms]": quantiles(1000 * took[WARM:], (50, 99)),
        f"{name}: the same, time of the processor [ms]": quantiles(1000 * used[WARM:], (50, 99)),
        f"{name}: load of the machine, least and most": f"{min(loads):.1f} and {max(loads):.1f}",
        f"{name}: last shown": newest,
    }


def _heap_mb(tab: Tab) -> float:
    """Memory of the scripts in the browser, after what is not used was let go [MB]."""
    tab.call("HeapProfiler.collectGarbage")
    return float(tab.call("Runtime.getHeapUsage")["usedSize"]) / 1e6
