"""Discovery beside a link says what it found, and changes nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Sample, Status
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.discovery import LiveDiscovery
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.runner.scenario.scenario import Scenario

WINDOW, LEAST = 60, 100


def judge(link_file: Path, record: Dataset, effects: tuple[Effect, ...]) -> Finding:
    """A search that costs nothing: how many rows it was given."""
    return Finding("none", f"{link_file.name} with {len(record)} rows, {len(effects)} effects")


def fails(link_file: Path, record: Dataset, effects: tuple[Effect, ...]) -> Finding:
    raise ValueError(f"{link_file.name} is beyond me")


@pytest.fixture(scope="module")
def watched(write_live_scenario: Callable[[Mapping[str, object]], Scenario], write_link: Callable[..., Link]) -> Link:
    options = {"window_s": WINDOW, "least_record_s": LEAST, "record_s": 150, "pause_s": 50}
    return write_link(write_live_scenario({"discovery": options}), {"controller": "hold"})


def outcome(link: Link, time: float, innovation: float) -> Outcome:
    """A cycle whose estimator was off by so much."""
    model, setup = link.scenario.model, link.scenario.setup
    off = np.full(len(model.outputs), np.nan)
    off[model.index("outputs", "concentrate_grade")] = innovation
    sample = Sample(time, np.ones(len(model.inputs)), off)
    q, m = len(setup.parameters), len(setup.outputs)
    state = np.zeros(len(model.states))
    estimate = Estimate(time, off, off, np.ones(m), np.ones(q), np.eye(q), state, Status.OK)
    return Outcome(round(time), Mode.MONITOR, "", (), {}, sample, estimate, None, {}, {}, False)


def said(discovery: LiveDiscovery, link: Link, offset: float, rows: int = 400, lost: Collection[int] = ()) -> list[str]:
    """What is said while innovations have this mean, in units of their standard deviation; some samples are lost."""
    noise = np.random.default_rng(1).standard_normal(rows)
    found = []
    for k in range(rows):
        if k in lost:
            continue
        words = discovery.look(outcome(link, k + 1.0, noise[k] + offset))
        if words.startswith("search begins"):
            while discovery._found is not None and not discovery._found.done():
                time.sleep(0.05)
        found += [words] if words else []
    return found


def test_an_alarm_starts_a_search_whose_verdict_is_said(watched: Link) -> None:
    discovery = LiveDiscovery(watched, judge)
    try:
        words = said(discovery, watched, offset=2.0)
    finally:
        discovery.close()
    assert words[0].startswith("alarm: concentrate_grade mean p =")
    assert words[1].startswith("search begins after an alarm of concentrate_grade mean")
    assert words[2] == "search ended: none: link.yaml with 100 rows, 0 effects"
    assert words[-1].endswith("with 150 rows, 0 effects"), "no record is longer than asked"


@pytest.fixture
def in_a_thread(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Searches run in a thread: a process of their own takes seconds to start, and the other tests have one."""
    with ThreadPoolExecutor(1) as pool:
        monkeypatch.setattr(LiveDiscovery, "_executor", lambda self: pool)
        yield


@pytest.mark.usefixtures("in_a_thread")
def test_a_few_lost_samples_are_rows_without_values_and_no_new_beginning(watched: Link) -> None:
    lost, records = (20, 21, 50, 80), list[Dataset]()

    def keep(link_file: Path, record: Dataset, effects: tuple[Effect, ...]) -> Finding:
        records.append(record)
        return judge(link_file, record, effects)

    discovery = LiveDiscovery(watched, keep)
    try:
        words = said(discovery, watched, offset=2.0, rows=130, lost=lost)
    finally:
        discovery.close()
    assert words[-1].startswith("search ended") and "with 100 rows" in words[-1]
    (record,) = records
    assert np.flatnonzero(np.isnan(record.outputs).all(axis=1)).tolist() == list(lost)
    np.testing.assert_allclose(np.diff(record.time), watched.scenario.dt)


def test_a_long_gap_begins_a_new_record(watched: Link) -> None:
    longest = round(watched.file.cycle.longest_gap_s / watched.scenario.dt)
    discovery = LiveDiscovery(watched, judge)
    try:
        words = said(discovery, watched, offset=2.0, rows=150, lost=range(40, 42 + longest))
    finally:
        discovery.close()
    assert words == [], "neither a window nor a record is whole"


def test_white_innovations_raise_no_alarm(watched: Link) -> None:
    assert said(LiveDiscovery(watched, judge), watched, offset=0.0) == []


def test_a_search_that_fails_is_said_too(watched: Link) -> None:
    discovery = LiveDiscovery(watched, fails)
    try:
        words = said(discovery, watched, offset=2.0, rows=150)
    finally:
        discovery.close()
    assert words[2] == "search failed: ValueError: link.yaml is beyond me"


def test_without_the_key_nobody_watches(link: Link) -> None:
    assert said(LiveDiscovery(link, judge), link, offset=5.0) == []
