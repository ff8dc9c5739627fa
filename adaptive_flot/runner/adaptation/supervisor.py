"""Watch a running loop; where its innovations stop being white, search for the cause and extend the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Estimate, Setup
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.adaptation.background import Background
from adaptive_flot.runner.adaptation.bumpless_transfer import BumplessTransfer, Rebuild, transfer
from adaptive_flot.runner.adaptation.inquiry import Inquiry
from adaptive_flot.runner.adaptation.measured_record import measured_record
from adaptive_flot.runner.adaptation.search import Finding, search_record
from adaptive_flot.runner.adaptation.whiteness_watch import Alarm, watch
from adaptive_flot.runner.loop.loop import Running, Step
from adaptive_flot.runner.results.run_arrays import innovations
from adaptive_flot.runner.scenario.discovery_options import DiscoveryOptions

WORSE = 0.02
"""An extension is refused where it makes the one-step error of a watched output larger by more than this share."""
Search = Callable[[Setup, Dataset, int], Finding]


@dataclass(frozen=True)
class _Started:
    alarm_s: float
    alarm: Alarm
    record: tuple[float, float]
    search: Background[Finding]


class Supervisor:
    """Looks at a loop after each interval (`run_loop(supervise=...)`). Made for one run, whose searches it holds.

    Innovations are tested window by window. After an alarm, and once the record is long enough, a search starts in a
    process of its own on what was measured until then. Its result is taken up a stated time later: nothing in a
    simulated run depends on how fast the machine is.

    A model is extended on two conditions. The verdict names an effect, and the extended model predicts the rows since
    the start of the search no worse; those rows did not enter the search.

    Parameters
    ----------
    options
        The scenario's key `discovery`.
    rebuild
        Makes estimator and controller for a model.
    search
        Judges a record; default `search_record`.

    Attributes
    ----------
    inquiries
        What came of each alarm so far.
    """

    def __init__(self, options: DiscoveryOptions, rebuild: Rebuild, search: Search | None = None) -> None:
        self.options = options
        self.inquiries: list[Inquiry] = []
        self._rebuild = rebuild
        self._search = search or search_record
        self._window: int | None = None  # first step of the window, once an estimator runs
        self._quiet_until = -np.inf
        self._alarm: tuple[float, Alarm] | None = None
        self._started: _Started | None = None

    def __call__(self, running: Running, steps: list[Step]) -> Running:
        """Look at the last step; the loop on an extended model where there is one to take up, else as it is."""
        if steps[-1].estimate is None:
            return running
        now, setup = steps[-1].plant.sample.time, running.estimator.setup
        if self._window is None:
            self._window = len(steps) - 1
        if self._started is not None:
            if now < self._started.record[1] + self.options.delay_s - 1e-9:
                return running
            return self._take_up(running, steps, now)
        if self._alarm is None:
            self._alarm = self._test(steps, now, setup)
        rows = self._record_rows(steps, setup)
        if self._alarm is not None and rows * setup.dt >= self.options.least_record_s - 1e-9:
            record = measured_record(steps[-rows:], setup)
            search = Background(lambda: self._search(setup, record, self.options.processes))
            span = (float(record.time[0]), float(record.time[-1]))
            self._started, self._alarm = _Started(*self._alarm, span, search), None
        return running

    def close(self) -> None:
        """End a search whose result nobody waits for."""
        if self._started is not None:
            self._started.search.stop()

    def _outputs(self, setup: Setup) -> tuple[str, ...]:
        return tuple(self.options.outputs or setup.outputs)

    def _record_rows(self, steps: Sequence[Step], setup: Setup) -> int:
        return min(len(steps), round(self.options.record_s / setup.dt))

    def _test(self, steps: Sequence[Step], now: float, setup: Setup) -> tuple[float, Alarm] | None:
        """Test a window that is full, and begin the next."""
        assert self._window is not None
        if (len(steps) - self._window) * setup.dt < self.options.window_s - 1e-9:
            return None
        window, self._window = steps[self._window :], len(steps)
        if len(self.extensions) >= self.options.most_effects or now < self._quiet_until:
            return None
        seen = np.vstack([s.outputs for s in in_time(innovations(window), setup)])
        columns = {name: seen[:, setup.model.index("outputs", name)] for name in self._outputs(setup)}
        alarm = watch(columns, self.options.false_alarm)
        return None if alarm is None else (now, alarm)

    @property
    def extensions(self) -> list[Inquiry]:
        """Inquiries whose result was taken up."""
        return [i for i in self.inquiries if i.extended]

    def _take_up(self, running: Running, steps: list[Step], now: float) -> Running:
        assert self._started is not None
        begun, self._started = self._started, None
        self._window = len(steps)
        inquiry = Inquiry(begun.alarm_s, begun.alarm.p_values, begun.record, now)
        goes_on = running
        try:
            finding = begun.search.result()
            inquiry = replace(inquiry, verdict=finding.verdict, why=f"the verdict is '{finding.verdict.word}'")
            if finding.extension.effects:
                transferred = transfer(running, steps, finding.extension, self._rebuild, begun.record[0])
                inquiry = self._compared(inquiry, transferred, running.estimator.setup)
                goes_on = transferred.running if inquiry.extended else running
        except Exception as error:  # the loop goes on without a search that failed, whatever it was
            words = str(error) if isinstance(error, AdaptiveFlotError) else f"{type(error).__name__}: {error}"
            inquiry = replace(inquiry, why=words)
        self._quiet_until = now if inquiry.extended else now + self.options.pause_s
        self.inquiries.append(inquiry)
        return goes_on

    def _compared(self, inquiry: Inquiry, transferred: BumplessTransfer, setup: Setup) -> Inquiry:
        """Whether the extended model is taken up: it follows the record, and predicts the rows since no worse."""
        if not all(np.isfinite(e.state).all() for e in transferred.after):
            return replace(inquiry, why="the extended model does not follow the record")
        columns = {name: setup.model.index("outputs", name) for name in self._outputs(setup)}
        since = inquiry.record_s[1]
        errors = {
            name: (one_step_error(transferred.before, j, since), one_step_error(transferred.after, j, since))
            for name, j in columns.items()
        }
        seen = {name: pair for name, pair in errors.items() if np.isfinite(pair).all()}
        if not seen:
            return replace(inquiry, errors=errors, why="nothing was measured since the search")
        worse = [name for name, (old, new) in seen.items() if new > (1 + WORSE) * old]
        why = f"the one-step error of {', '.join(worse)} grows on rows that did not enter the search" if worse else ""
        return replace(inquiry, errors=errors, extended=not worse, why=why)


def one_step_error(estimates: Sequence[Estimate], column: int, since: float) -> float:
    """Root mean square innovation of an output after a time [s]; NaN where nothing was measured."""
    seen: FloatArray = np.array([e.innovation[column] for e in estimates if e.time > since + 1e-9])
    seen = seen[np.isfinite(seen)]
    return float(np.sqrt(np.mean(seen**2))) if seen.size else float("nan")
