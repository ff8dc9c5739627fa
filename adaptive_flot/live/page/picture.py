"""What the page shows of a cycle: plain numbers and words. The page puts words in as text, never as HTML."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from adaptive_flot.contracts import Estimate, OperatingPoint, Plan, Sample, Status, full_parameters
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.page.axes import Axes, plain
from adaptive_flot.live.page.beside import BesideTheChart
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.safety.checks import Check
from adaptive_flot.live.safety.modes import Mode

SOLVED = (Status.OK, Status.RETRIED, Status.SOFTENED)
NO_DECISION, NO_VALUE = "no decision", "not read"
USUAL = {"ok", "no new value"}
LOOKS = {
    Check.BAD.value: 0,
    Check.BAD_CODE.value: 0,
    Status.HELD.value: 0,
    Status.SAFE_INPUT.value: 0,
    Check.OUT_OF_RANGE.value: 1,
    Check.JUMP.value: 1,
    Status.SHIFTED_PLAN.value: 1,
    Check.FROZEN.value: 2,
    Status.RETRIED.value: 2,
    Check.BACKWARD.value: 3,
    Check.FUTURE.value: 3,
    Check.UNCERTAIN.value: 5,
}
MOST_SAID = 300
"""Characters of what discovery says."""
OTHER = 4
"""Colour of states that are neither usual nor above."""


class Pictures:
    """Makes what the page shows, cycle after cycle.

    Parameters
    ----------
    link
        The link file and its scenario.
    """

    def __init__(self, link: Link) -> None:
        self.link, self.axes = link, Axes(link)
        self._beside = BesideTheChart(link, self.axes)
        scenario = link.scenario
        self._names = scenario.model.names("outputs")
        measured = [name for name in link.file.tags if name in self._names]
        self._strips = ["solver", *measured]
        self._time = math.nan
        self._solved, self._solves = math.nan, False
        self._plan: Plan | None = None
        self._said = ""
        self._offset = math.nan
        self._outputs: tuple[Model, FastCall] | None = None

    def spec(self) -> dict[str, Any]:
        """What stays the same: names, panels, strips."""
        file, scenario = self.link.file, self.link.scenario
        return {
            "title": scenario.name.replace("_", " "),
            "estimator": file.estimator,
            "controller": file.controller,
            "highest": file.highest_mode,
            "interval": scenario.dt / file.cycle.speed,
            "dt": scenario.dt,
            "panels": self.axes.spec(),
            "strips": [name.replace("_", " ") for name in self._strips],
            "states": {"usual": sorted(USUAL), "looks": LOOKS, "other": OTHER},
        }

    def of(self, progress: Progress) -> tuple[list[Any], dict[str, Any]]:
        """Row of the panels (time, numbers of the lines, states of the strips), and what is shown of now."""
        told = progress.snapshot.time
        self._time = told if math.isfinite(told) else self._time + self.link.scenario.dt
        self._said = progress.found.split("\n")[0][:MOST_SAID] or self._said
        if progress.outcome.sample is not None:
            self._offset = self._time - progress.outcome.sample.time
        self._take(progress)
        states = self._states(progress)
        row = [plain(self._time, 14), *self.axes.row(progress), *states]
        outcome = progress.outcome
        now = {
            "cycle": outcome.number,
            "time": plain(self._time, 14),
            "mode": outcome.mode.name.lower(),
            "head": self._head(progress),
            "switch": self._switch(progress),
            "link": self._link(progress),
            "tags": self._tags(progress),
            "solver": {"state": states[0], "age": self._age()},
            "alarms": [
                {
                    "key": a.key,
                    "words": a.words,
                    "since": plain(self._clock(a.since), 14),
                    "active": a.active,
                    "by": a.acknowledged,
                }
                for a in progress.alarms.values()
            ],
            "reverts": progress.extended,
            "effects": self._beside.effects(progress),
            "card": self._beside.card(progress, self._offset),
            "discovery": self._said,
            "shadows": [self._beside.shadow(v) for v in progress.shadows.values()],
            "plan": self._planned(progress),
        }
        return row, now

    def _take(self, progress: Progress) -> None:
        decision = progress.outcome.decision
        if decision is None:
            if progress.outcome.mode not in (Mode.ADVISORY, Mode.CLOSED):
                self._plan = None
            return
        solve = math.isfinite(decision.solve_seconds)
        self._solves = self._solves or solve
        if decision.status in SOLVED and (solve or not self._solves):
            self._solved = self._time
        if decision.plan is not None:
            self._plan = decision.plan

    def _age(self) -> float | None:
        """Age of the last good solve [s]."""
        return plain(self._time - self._solved)

    def _clock(self, record_time: float) -> float:
        """A time of the record by the plant's clock [s]."""
        return record_time + self._offset

    def _states(self, progress: Progress) -> list[str]:
        decision, checks = progress.outcome.decision, progress.outcome.checks
        solver = NO_DECISION if decision is None else decision.status.value
        return [solver, *(checks[n].value if n in checks else NO_VALUE for n in self._strips[1:])]

    def _head(self, progress: Progress) -> dict[str, Any]:
        sample, estimate = progress.outcome.sample, progress.outcome.estimate
        axis = next((a for a in self.axes.axes if a.kind == "output"), None)
        head: dict[str, Any] = {"grade": None, "recovery": None, "money": None}
        if axis is not None:
            measured = math.nan if sample is None else float(sample.outputs[axis.column])
            smooth = math.nan if estimate is None else float(estimate.prediction[axis.column])
            head["grade"] = {
                "label": axis.shown.label,
                "unit": axis.shown.unit,
                "measured": plain(axis.shown.factor * measured),
                "predicted": plain(axis.shown.factor * smooth),
                "limits": list(axis.limits),
            }
        if sample is None or estimate is None:
            return head
        outputs, point = self._point(progress.model, sample, estimate)
        if "recovery" in self._names:
            head["recovery"] = plain(100 * float(outputs[self._names.index("recovery")]))
        prices = self.link.scenario.prices
        if prices is not None:
            rates = prices.rates(point, prices.prices())
            head["money"] = plain(3600 * float(sum(float(rate) for rate in rates.values())))
        return head

    def _point(self, model: Model, sample: Sample, estimate: Estimate) -> tuple[Any, OperatingPoint]:
        """Outputs (ny,) and operating point of the model in use, at an estimate."""
        if self._outputs is None or self._outputs[0] is not model:
            self._outputs = (model, FastCall(model.ode))
        known = sample.parameters
        if known is not None:
            known = np.concatenate([known, model.parameter_values[len(known) :]])
        full = full_parameters(model, self.link.scenario.setup.parameters, estimate.parameters, known)
        outputs = self._outputs[1](estimate.time, estimate.state, sample.inputs, full)[1]
        return outputs, OperatingPoint(model, estimate.state, sample.inputs, outputs, full)

    def _switch(self, progress: Progress) -> dict[str, Any]:
        snapshot, modes = progress.snapshot, progress.modes
        return {
            "plant": None if snapshot.switch is None else snapshot.switch.name.lower(),
            "page": snapshot.allowed.name.lower(),
            "armed": modes.armed,
            "waiting": modes.waiting > 0,
            "reason": progress.outcome.reason,
        }

    def _link(self, progress: Progress) -> dict[str, Any]:
        return {
            "alive": progress.snapshot.alive,
            "connected": progress.connected,
            "ms": plain(1000 * progress.seconds, 3),
            "faults": list(progress.outcome.faults),
        }

    def _tags(self, progress: Progress) -> list[dict[str, Any]]:
        found = []
        for name in self._strips[1:]:
            check = progress.outcome.checks.get(name)
            history = progress.histories.tags.get(name)
            age = math.nan if history is None else self._time - history.believed_at
            state = NO_VALUE if check is None else check.value
            found.append({"name": name.replace("_", " "), "state": state, "age": plain(age)})
        return found

    def _planned(self, progress: Progress) -> dict[str, Any] | None:
        if self._plan is None or progress.outcome.sample is None:
            return None
        ends = [plain(self._clock(float(t)), 14) for t in self._plan.time]
        return {"time": ends, "values": self.axes.plan(self._plan)}
