"""From what the tags say to a sample: every value is checked first, and one that fails is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from adaptive_flot.contracts import DelayedValue, Sample
from adaptive_flot.live.link_file import Link, tagged_quantities
from adaptive_flot.live.link_keys import Scale
from adaptive_flot.live.safety.checks import Check, TagHistory, TagRules, check
from adaptive_flot.live.snapshot import Snapshot

USABLE = (Check.OK, Check.OLD)


@dataclass(frozen=True)
class Histories:
    """What the checks of the next cycle need, by name of the quantity, and by input for the set-points that act."""

    tags: Mapping[str, TagHistory] = field(default_factory=dict)
    acting: Mapping[str, TagHistory] = field(default_factory=dict)


@dataclass(frozen=True)
class Reading:
    """What a cycle may compute with.

    Attributes
    ----------
    sample
        The sample; None where an input has never been known.
    checks
        What each value was found to be.
    acting
        Set-point that acts by input, NaN where it is not known for certain.
    good
        Every value that a move is computed from is good.
    """

    sample: Sample | None
    checks: Mapping[str, Check]
    acting: Mapping[str, float]
    good: bool


class Samples:
    """Makes samples of what the tags of a link say."""

    def __init__(self, link: Link) -> None:
        scenario = link.scenario
        model = scenario.model
        self._model, self._dt = model, scenario.dt
        known = tagged_quantities(scenario)
        self.rules: dict[str, TagRules] = {
            name: tag.rules(Scale.of(tag.unit, known[name].unit), known[name].lower, known[name].upper)
            for name, tag in link.file.tags.items()
        }
        self._of_acting = {  # a set-point may stand still and step, but not leave the range of what it sets
            name: TagRules(self.rules[name].low, self.rules[name].high, self.rules[name].stale_after_s)
            for name in link.file.writes
        }
        limited = () if scenario.limits is None else tuple(scenario.limits.outputs)
        self._inputs = model.names("inputs")
        self._needed = tuple(dict.fromkeys([*scenario.setup.outputs, *(n for n in limited if n in self.rules)]))
        self._outputs = [(j, q.name) for j, q in enumerate(model.outputs) if q.name in self.rules]
        self._parameters = {
            f"parameter.{model.parameters[i].name}": i
            for i in scenario.measured_parameters
            if f"parameter.{model.parameters[i].name}" in self.rules
        }

    def read(
        self, histories: Histories, snapshot: Snapshot, time: float, before: Sample | None
    ) -> tuple[Histories, Reading]:
        """Check every value, and make the sample at a time [s] of the grid; `before` is the last one."""
        tags, checks = dict(histories.tags), {}
        fresh: dict[str, float] = {}
        for name, rules in self.rules.items():
            old = tags.get(name, TagHistory())
            tags[name], checks[name] = check(rules, old, snapshot.tags.get(name), snapshot.time)
            if checks[name] is Check.OK:
                fresh[name] = tags[name].believed
        acting_tags, acting = dict(histories.acting), {}
        for name, rules in self._of_acting.items():
            old = acting_tags.get(name, TagHistory())
            acting_tags[name], found = check(rules, old, snapshot.acting.get(name), snapshot.time)
            acting[name] = acting_tags[name].held(rules, snapshot.time) if found in USABLE else math.nan
        after = Histories(tags, acting_tags)
        held = {name: tags[name].held(self.rules[name], snapshot.time) for name in self.rules}
        good = (
            all(checks[name] in USABLE and math.isfinite(held[name]) for name in self._inputs)
            and all(math.isfinite(held[name]) for name in (*self._needed, *self._parameters))
            and all(math.isfinite(value) for value in acting.values())
        )
        sample = self._sample(after, held, fresh, snapshot.time, time, before)
        return after, Reading(sample, checks, acting, good)

    def _sample(
        self,
        histories: Histories,
        held: Mapping[str, float],
        fresh: Mapping[str, float],
        now: float,
        time: float,
        before: Sample | None,
    ) -> Sample | None:
        inputs = np.array([held[name] for name in self._inputs])
        unknown = ~np.isfinite(inputs)
        if unknown.any():
            if before is None:
                return None
            inputs[unknown] = before.inputs[unknown]
        outputs = np.full(len(self._model.outputs), np.nan)
        delayed = []
        for j, name in self._outputs:
            if name not in fresh:
                continue
            taken = histories.tags[name].believed_at
            if now - taken < self._dt / 2:
                outputs[j] = fresh[name]
            else:
                delayed.append(DelayedValue(name, time - (now - taken), fresh[name]))
        return Sample(time, inputs, outputs, tuple(delayed), self._known(held, before))

    def _known(
        self, held: Mapping[str, float], before: Sample | None
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]] | None:
        if not self._parameters:
            return None
        values = self._model.parameter_values.copy()
        if before is not None and before.parameters is not None:
            values = before.parameters.copy()
        for name, i in self._parameters.items():
            if math.isfinite(held[name]):
                values[i] = held[name]
        return values


def forgotten(histories: Histories) -> Histories:
    """After the plant's clock went back nothing that was seen can be compared with what comes."""
    return replace(histories, tags={}, acting={})
