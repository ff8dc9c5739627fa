"""Protects events against short pauses: chance parts one event in two, and a switch stands in for what lasts.

A basin whose probe shows less from 2000 to 4000 s (see `verdicts.test_without_a_site`).
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.cross_validation import model_with
from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.pauses import (
    has_blip,
    has_short_pause,
    is_hardly_off,
    without_short_pauses,
)
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.rivals import unless_hardly_off
from adaptive_flot.greybox.effects import Effect
from tests.discovery.innovations.verdicts.test_without_a_site import judged, record

PROBE = 0.85
SHORTEST = 10
"""Rows at the end below which what follows an event here is none."""


def switched(*spells: tuple[float, float]) -> Hypothesis:
    """The probe shows another share in some spells: begin and length [s]."""
    told = {"amplitude": 0.0}
    for k, (begin, long) in enumerate(spells, 1):
        told |= {f"on_{k}": begin, f"for_{k}": long}
    effect = Effect("probe", "time", "switch", told, {"count": float(len(spells)), "width": 0.5}, mode="factor")
    return Hypothesis("probe", "time", "switch", effect, ("amplitude",), ({},))


def fitted(search: Search, base: Explanation, h: Hypothesis) -> Explanation:
    model = model_with(search.model, h)
    p = model.parameter_values
    p[: len(base.fit.p)] = base.fit.p
    p[model.index("parameters", h.parameters[0])] = np.log(PROBE)
    with np.errstate(all="ignore"):
        return search.added(base, h, p)


@pytest.mark.parametrize(
    ("spells", "short"),
    [
        (((2000.0, 2000.0),), False),
        (((2000.0, 900.0), (3000.0, 1000.0)), True),
        (((2000.0, 600.0), (3400.0, 600.0)), False),
        (((100.0, 50.0), (2000.0, 900.0), (2950.0, FOREVER)), True),
    ],
)
def test_a_pause_is_short_beside_the_spells_about_it(spells: tuple[tuple[float, float], ...], short: bool) -> None:
    assert has_short_pause(switched(*spells)) == short


@pytest.mark.parametrize(
    ("spells", "hardly"),
    [
        (((100.0, 180.0), (286.0, 180.0), (472.0, 180.0)), True),  # a ship whose inertia has doubled
        (((100.0, 50.0), (2000.0, 900.0), (2950.0, FOREVER)), True),
        (((1.6, 2.8), (9.4, 0.3), (9.9, 1.2), (15.0, 1.1), (16.2, 1.6)), False),  # leant on three times
        (((1000.0, 900.0), (3000.0, 900.0)), False),
    ],
)
def test_beside_long_pauses_a_short_one_leaves_the_event(spells: tuple[tuple[float, float], ...], hardly: bool) -> None:
    assert is_hardly_off(switched(*spells)) == hardly


@pytest.mark.parametrize(
    ("spells", "blip"),
    [
        (((2000.0, 2000.0),), False),
        (((1000.0, 20.0), (2000.0, 2000.0)), True),  # two rows of ten seconds
        (((1000.0, 60.0), (2000.0, 2000.0)), False),
        (((1000.0, 20.0), (2000.0, 20.0)), False),  # nothing that lasts: spikes of a sensor
        (((1000.0, 20.0), (2000.0, FOREVER)), True),
    ],
)
def test_a_blip_is_as_long_as_an_outlier_beside_a_spell_that_lasts(
    spells: tuple[tuple[float, float], ...], blip: bool
) -> None:
    assert has_blip(switched(*spells), 10.0) == blip


def test_an_outlier_is_no_spell_of_an_event() -> None:
    """A gauge was off in one row: a leak was told "from 7.47 to 7.49 s, and from 8.99 s on"."""
    whole, _, _ = judged(record(2, probe=PROBE))
    base = whole.base(whole.model.parameter_values)
    dt = whole.record.dt
    lasting, with_blip = ((2000.0, 2000.0),), ((1000.0, 2 * dt), (2000.0, 2000.0))
    told = without_short_pauses(whole, fitted(whole, base, switched(*with_blip)))
    assert told.hypotheses[0].pulses == lasting
    two = fitted(whole, base, switched((1000.0, 6 * dt), *lasting))
    assert without_short_pauses(whole, two) is two  # too long for an outlier: another rule asks what it gains


def test_a_pause_that_is_not_there_is_closed_and_one_that_is_stays() -> None:
    whole, _, _ = judged(record(2, probe=PROBE))
    base = whole.base(whole.model.parameter_values)
    parted = fitted(whole, base, switched((2000.0, 1000.0), (3050.0, 950.0)))
    with np.errstate(all="ignore"):
        closed = without_short_pauses(whole, parted)
    assert closed.hypotheses[0].pulses == ((2000.0, 2000.0),)
    assert closed.criterion > parted.criterion and closed.numbers < parted.numbers
    data = record(2, probe=PROBE)
    data.outputs[310:322] /= PROBE  # 120 s in which it shows what is there
    search, base, _ = judged(data)
    parted = fitted(search, base, switched((2000.0, 1100.0), (3220.0, 780.0)))
    with np.errstate(all="ignore"):
        assert without_short_pauses(search, parted) is parted


@pytest.mark.parametrize("rows", [3, 30])
def test_an_event_that_ends_just_before_the_record_lasts_unless_the_rows_after_it_say_so(rows: int) -> None:
    """A brine was weaker "from 12020 to 21920 s", four rows before the end of a record in which it stayed so."""
    data = record(2)
    begin, end = 2000.0, float(data.time[-1]) - rows * data.dt
    over = data.time >= (end if rows > SHORTEST else np.inf)
    data.outputs[(data.time >= begin) & ~over] *= PROBE
    search, base, _ = judged(data)
    ended = fitted(search, base, switched((begin, end - begin)))
    with np.errstate(all="ignore"):
        told = without_short_pauses(search, ended)
    assert told.hypotheses[0].pulses == (((begin, FOREVER),) if rows <= SHORTEST else ended.hypotheses[0].pulses)


@pytest.mark.parametrize(("beside", "word"), [(None, "abstain"), ("rate of salt", "named")])
def test_an_event_that_stops_for_short_pauses_only_is_not_told_alone(beside: str | None, word: str) -> None:
    """A ship whose inertia had doubled was told as a rudder, in five spells."""
    h = switched((10.0, 182.0), (198.0, 166.0))
    best: Any = SimpleNamespace(hypotheses=(h,))
    told = Told("named", best, (h,), (), (best,), "", beside)  # type: ignore[arg-type]
    assert unless_hardly_off(told).word == word
    once = switched((10.0, 182.0), (400.0, 166.0))
    best = SimpleNamespace(hypotheses=(once,))
    assert unless_hardly_off(Told("named", best, (once,), (), (best,), "")).word == "named"
