"""Discovery beside a link: watches the innovations, searches for a cause, says what it found, and applies nothing.

What is found is stored as an event, and shown. Whether the model in use is extended is decided elsewhere.
"""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from adaptive_flot.contracts import Decision, Estimate, PlantRecord, Sample, Setup, Status
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.children import beside_the_cycle
from adaptive_flot.live.link.estimation import missing
from adaptive_flot.live.link_file import Link, load_link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.runner.adaptation.measured_record import measured_record
from adaptive_flot.runner.loop.loop import Step
from adaptive_flot.runner.results.run_arrays import innovations

Search = Callable[[Path, Dataset, tuple[Effect, ...]], Finding]


def search(link_file: Path, record: Dataset, effects: tuple[Effect, ...]) -> Finding:
    """Search a record for what the model in use lacks. Runs in a process of its own.

    Parameters
    ----------
    link_file
        The link file.
    record
        What was measured.
    effects
        What the model in use has beyond the scenario's.
    """
    from adaptive_flot.runner.adaptation.search import search_record

    link = load_link(link_file)
    options, setup = link.scenario.file.discovery, link.scenario.setup
    if effects:
        setup = replace(setup, model=setup.model.with_effects(effects))
    found = search_record(setup, record, 1 if options is None else options.processes)
    verdict, extension = found.verdict, found.extension
    evidence = [str(symptom) for symptom in verdict.detection.symptoms] if verdict.detection else []
    evidence += [f"{e.effect.label}: {e.meaning}" for e in verdict.effects]
    errors = tuple((c.output, c.unit, c.before, c.after) for c in verdict.error)
    more = (*evidence, *verdict.drift, *verdict.notes)
    fitted = tuple(extension.parameters.items()), float(record.time[0]), extension.initial_state
    return Finding(verdict.word, verdict.reason, more, errors, extension.effects, *fitted)


class LiveDiscovery:
    """Watches a link as its scenario's key `discovery` says; without the key it does nothing.

    Parameters
    ----------
    link
        The link file and its scenario.
    searcher
        Judges a record; default `search`.
    effects
        What the model in use has beyond the scenario's.

    Attributes
    ----------
    finding
        What the last search found; None before the first.
    """

    def __init__(self, link: Link, searcher: Search = search, effects: tuple[Effect, ...] = ()) -> None:
        self.finding: Finding | None = None
        self._effects = effects
        self._options = link.scenario.file.discovery if link.file.estimator in link.scenario.watched else None
        self._path, self._search = link.path.absolute(), searcher
        self._setup: Setup = link.scenario.setup
        self._pool: ProcessPoolExecutor | None = None
        self._found: Future[Finding] | None = None
        self._longest = round(link.file.cycle.longest_gap_s / self._setup.dt)
        self._alarm, self._quiet_until, self._window = "", -np.inf, 0
        if self._options is not None:  # its libraries take a second or two to load, which no cycle may wait for
            from adaptive_flot.runner.adaptation.whiteness_watch import watch

            self._watch = watch
        rows = 0 if self._options is None else max(self._options.record_s, self._options.window_s) / self._setup.dt
        self._steps: deque[Step] = deque(maxlen=round(rows) + 1)

    def look(self, outcome: Outcome) -> str:
        """Look at a cycle; words to store and to say, empty where there is nothing new."""
        if self._options is None or outcome.sample is None:
            return ""
        last = self._steps[-1].plant.sample.time if self._steps else outcome.sample.time - self._setup.dt
        missed = round((outcome.sample.time - last) / self._setup.dt) - 1
        if missed > self._longest:
            self._steps.clear()
            self._window = 0
        elif missed > 0:  # a record has no holes: samples that nobody has seen, with inputs as before
            before = self._steps[-1].plant.sample
            times = [last + (k + 1) * self._setup.dt for k in range(missed)]
            self._steps += [_step(missing(before, time), None) for time in times]
            self._window += missed if self._window else 0
        self._steps.append(_step(outcome.sample, outcome.estimate))
        if self._found is not None:
            return self._result(outcome.sample.time)
        self._window = self._window + 1 if outcome.estimate is not None else 0
        words = self._test(outcome.sample.time) if self._window * self._setup.dt >= self._options.window_s else ""
        if self._alarm and len(self._steps) * self._setup.dt >= self._options.least_record_s:
            record = measured_record(list(self._steps)[-round(self._options.record_s / self._setup.dt) :], self._setup)
            self._found = self._executor().submit(self._search, self._path, record, self._effects)
            begun = f"search begins after an alarm of {self._alarm}"
            self._alarm = ""
            return begun
        return words

    def inputs_since(self, time: float) -> FloatArray | None:
        """Inputs of all samples after a time [s], (rows, nu); None where the record does not reach back so far."""
        times = [step.plant.sample.time for step in self._steps]
        if not times or times[0] > time + 1.5 * self._setup.dt:
            return None
        later = [step.plant.sample.inputs for step, at in zip(self._steps, times, strict=True) if at > time + 1e-9]
        return np.vstack(later) if later else None

    def close(self) -> None:
        """End a search whose result nobody waits for."""
        if self._pool is not None:
            processes = list(self._pool._processes.values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            self._pool = None

    def _test(self, now: float) -> str:
        assert self._options is not None
        rows, self._window = self._window, 0
        if now < self._quiet_until or self._alarm:
            return ""
        seen = np.vstack([s.outputs for s in in_time(innovations(list(self._steps)[-rows:]), self._setup)])
        names = self._options.outputs or self._setup.outputs
        columns = {name: seen[:, self._setup.model.index("outputs", name)] for name in names}
        alarm = self._watch(columns, self._options.false_alarm)
        self._alarm = "" if alarm is None else str(alarm)
        return f"alarm: {self._alarm}" if self._alarm else ""

    def _result(self, now: float) -> str:
        """What a search found, once it has ended."""
        assert self._found is not None and self._options is not None
        if not self._found.done():
            return ""
        found, self._found = self._found, None
        self._quiet_until, self._window = now + self._options.pause_s, 0
        try:
            self.finding = found.result()
            return f"search ended: {self.finding}"
        except Exception as error:  # the link goes on without a search that failed, whatever it was
            return f"search failed: {type(error).__name__}: {error}"

    def _executor(self) -> ProcessPoolExecutor:
        """A process that shares nothing with this one: the link has threads, which no fork may copy."""
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, context, initializer=beside_the_cycle, initargs=(os.getpid(),))
        return self._pool


def _step(sample: Sample, estimate: Estimate | None) -> Step:
    unknown = np.full_like(sample.outputs, np.nan)
    return Step(
        Decision(sample.inputs, Status.OK, "plant"), PlantRecord(sample, unknown, unknown, sample.inputs), estimate
    )
