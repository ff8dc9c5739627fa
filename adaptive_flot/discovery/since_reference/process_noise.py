"""What the innovations form says of a new record, by a model that has what its reference lacks too.

What the model lacks on the reference has not changed. A slow part or a dependence is found there, and added before. A
constant that is a little off is not: nothing tells it from a calibration that has changed, until the new record shows
the same one beside an event.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import EVENTS, Hypothesis
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.pauses import with_pauses_closed
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.sole_cause import sole_cause
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.greybox.data.dataset import Dataset

LACKING = ("lag", "store", "depends", "turns", "sign")
"""Kinds of effects that a model may lack on its reference."""
FAR = 3.0
"""An error so many times its usual one, in the model as it is, is surely new."""
LARGER = 2.0
"""Process noise so many times that of the reference may hide an event."""
NEAR = 0.1
"""Process noise of the reference, as a share of that of the new record, that is tried itself."""
AS_LARGE = 0.8
"""An effect is the same on the reference where its size there brings so much of what it gains in the new record."""


@dataclass(frozen=True)
class Looked:
    """The search in the new record, the model as it is there, all explanations, and what was judged."""

    search: Search
    base: Explanation
    found: list[Explanation]
    told: Told


@dataclass(frozen=True)
class Known:
    """What is known with process noise.

    Attributes
    ----------
    search, base
        The search in the new record, and the model as it is there.
    told, sole
        What was judged; and what is certain alone, of explanations of two effects.
    before
        The search in the reference, and the model as it is there.
    single
        Explanations of one effect that were found, told or not.
    hidden
        What tells events beside less noise than this record asks for, where nothing is told else; None without (see
        `_is_hidden`).
    """

    search: Search
    base: Explanation
    told: Told
    sole: Told | None
    before: tuple[Search, Explanation]
    single: tuple[Explanation, ...]
    hidden: Looked | None


def with_process_noise(
    compared: Comparison,
    record: Dataset,
    reference: Dataset,
    processes: int,
    progress: Callable[[str], None],
    ends: float,
) -> Known | None:
    """What has changed, by a model that has what the reference lacks; None where the time was up before.

    Where two effects explain the record best, an event and one that the reference shows as large, the event is looked
    for beside that one: see `_on_the_reference_too`.

    Parameters
    ----------
    compared
        The comparison by free runs, with its calibration.
    record, reference
        The new record, and the one on which the model was right.
    processes, progress, ends
        As for `find_changes`; `ends` is a `time.monotonic`.
    """
    calibration, columns = compared.calibration, compared.rows.columns
    constants, model = calibration.constants, calibration.model
    floor = noise_floor([reference], columns)
    progress("what the reference lacks")
    before = Search(model, reference, columns, floor, constants.names, constants, processes, LACKING, ends=ends)
    start = before.base(model.parameter_values)
    lacking = judge(before, start, best_explanations(before, start))
    if before.time_is_up:
        return None

    def look(there: Explanation, noise: tuple[float, float] | None = None) -> Looked | None:
        """The new record, by the model with what an explanation of the reference has; with this noise, if given."""
        extended = before.model_of(there)
        known = constants.about(extended.parameter_values[list(extended.indices("parameters", constants.names))])
        search = Search(
            extended,
            record,
            columns,
            floor,
            constants.names,
            known,
            processes,
            since_reference=True,
            noise=noise,
            ends=ends,
        )
        base = search.base(extended.parameter_values)
        found = with_pauses_closed(search, best_explanations(search, base, progress))
        return None if search.time_is_up else Looked(search, base, found, judge(search, base, found))

    there = lacking.best if lacking.word == "named" else start
    progress("events in the new record")
    looked = look(there)
    if looked is None:
        return None
    beside = _on_the_reference_too(looked, before, there)
    if beside is not None:
        progress("events beside what the reference shows too")
        again = look(beside)
        if again is not None and again.told.word in WITH_A_NAME:
            looked, there = again, beside
    hidden = None
    for noise in _less_noise(looked, there) if _is_hidden(compared, looked) else ():
        progress("events beside less noise")
        again = look(there, noise)
        if again is None:
            return None
        if again.told.word in WITH_A_NAME and all(h.kind in EVENTS for h in again.told.effects):
            hidden = again
            break
    search, base, found, told = looked.search, looked.base, looked.found, looked.told
    before = replace(before, model=search.model)
    as_it_is = before.base(search.model.parameter_values)
    told = _changed(told, search, before, as_it_is)
    single = tuple(e for e in found if len(e.hypotheses) == 1)
    return Known(search, base, told, sole_cause(search, base, found, told), (before, as_it_is), single, hidden)


def _is_hidden(compared: Comparison, looked: Looked) -> bool:
    """Whether process noise may hide an event: nothing is told, though a free run errs by many times what is usual.

    A store takes up slowly what is switched for a time. Noise that is large enough draws that from row to row, and
    nothing is left to explain.
    """
    far = any(c.before > FAR * c.noise for c in compared.verdict.error)
    return far and compared.verdict.word == "abstain" and looked.told.word not in WITH_A_NAME


def _less_noise(looked: Looked, there: Explanation) -> list[tuple[float, float]]:
    """Sizes of the noise with less process noise, to be tried in turn; measurement noise is that of the reference.

    None where the reference asks for about as much (LARGER): then it is how the process wanders. Half way to the
    reference in logarithms, and as there, where that is at least a NEAR part. Beside far less, a model without the
    event is so far off that times come out wrong, and another part may draw what is left.
    """
    (theta, _), (usual, rho) = looked.base.fit.size, there.fit.size
    if theta <= LARGER * usual:
        return []
    tried = [float(np.sqrt(theta * usual)), usual]
    return [(size, rho) for size in tried[: 2 if usual >= NEAR * theta else 1]]


def _on_the_reference_too(looked: Looked, before: Search, there: Explanation) -> Explanation | None:
    """What explains the reference with an effect more, beside which an event is best in the new record.

    None where something is told, or no event is among the two effects of the best explanation. And where the other one,
    with the size that it has on the reference, brings less than AS_LARGE of what it gains alone in the new record.
    """
    search, base, best = looked.search, looked.base, looked.found[0]
    events = [h for h in best.hypotheses if h.kind in EVENTS]
    if looked.told.word in WITH_A_NAME or len(best.hypotheses) != 2 or len(events) != 1 or search.time_is_up:
        return None
    (other,) = (h for h in best.hypotheses if h is not events[0])
    model = search.model_of(best)
    extended = model_with(before.model_of(there), other)
    p = extended.parameter_values
    own = list(extended.indices("parameters", other.parameters))
    p[own] = [model.parameters[model.index("parameters", name)].value for name in other.parameters]
    shown = before.added(there, other, p)
    if not shown.criterion > there.criterion + LEAST_GAIN:
        return None
    held = replace(search, model=before.model_of(shown))
    as_on_the_reference = held.base(held.model.parameter_values).criterion - base.criterion
    gain = search.without(best, events[0]).criterion - base.criterion
    return shown if as_on_the_reference >= AS_LARGE * gain > 0 else None


def _changed(told: Told, search: Search, before: Search, start: Explanation) -> Told:
    """What is told, without what explains the reference as well: that has not changed."""

    def there(explanation: Explanation, h: Hypothesis) -> bool:
        if h.kind in EVENTS:
            return False
        model = search.model_of(explanation)
        extended = model_with(before.model, h)
        p = np.array([model.parameters[model.index("parameters", q.name)].value for q in extended.parameters])
        p[list(extended.indices("parameters", before.free))] = start.fit.p[
            list(before.model.indices("parameters", before.free))
        ]
        return before.added(start, h, p).criterion > start.criterion + LEAST_GAIN

    certain = tuple(h for h in told.certain if not there(told.best, h))
    return replace(told, certain=certain, open=tuple((e, h) for e, h in told.open if not there(e, h)))
