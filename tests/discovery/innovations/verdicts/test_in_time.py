"""Protects: a change in time is not told as a dependence on what moved slowly meanwhile; and a dependence still is one.

A reactor that is fed in steps, with a rate that falls by a third in the middle of the record or follows the hall's
temperature. The records are simulated here by Euler's rule.
"""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.in_words import told_in_words
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts.in_time import or_in_time
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.model import FloatArray

ROWS, DT, RATE, FLUSH = 500, 20.0, 2e-3, 1e-3
NOISE, WANDERS = 0.02, 0.0005


def reactor() -> Model:
    """What is fed reacts by a constant rate."""

    def equations(m: Scope) -> None:
        c = m.state("salt")
        rate = m.site("rate", m.parameter("rate"), "process", unit="1/s")
        m.derivative("salt", FLUSH * (m.input("feed") - c) - rate * c)
        m.output("probe", m.site("probe", c, "sensor", unit="g/L"))

    return Model(
        name="reactor",
        states=(Quantity("salt", "g/L", "", -10.0, 100.0, scale=1.0),),
        inputs=(Quantity("feed", "g/L", "", 0.0, 100.0), Quantity("hall", "degC", "", 0.0, 50.0)),
        parameters=(Parameter("rate", RATE, "1/s", "", lower=1e-4, upper=1e-2, scale=5e-4, role="estimated"),),
        outputs=(Quantity("probe", "g/L", "", scale=1.0),),
        equations=equations,
        max_step_s=DT,
        initial_guess={"salt": 5.0},
        starts_steady=False,
    )


def judged(factor: FloatArray, hall: FloatArray, seed: int) -> tuple[Search, Explanation, Told]:
    rng = np.random.default_rng(seed)
    feed = np.repeat(rng.uniform(10.0, 20.0, ROWS // 20), 20)
    salt, seen = 5.0, np.zeros(ROWS)
    for k in range(ROWS):
        seen[k] = salt + NOISE * rng.normal()
        if k + 1 < ROWS:
            salt += DT * (FLUSH * (feed[k + 1] - salt) - RATE * factor[k] * salt)
            salt += WANDERS * np.sqrt(DT) * rng.normal()
    time = DT * np.arange(ROWS, dtype=float)
    data = Dataset("reactor", time, DT, np.column_stack([feed, hall]), seen[:, None])
    search = Search(reactor(), data, (0,), noise_floor([data], (0,)), ("rate",))
    with np.errstate(all="ignore"):
        base = search.base(search.model.parameter_values)
        return search, base, judge(search, base, best_explanations(search, base))


SHARE = np.linspace(0.0, 1.0, ROWS)
COOLER = 24.0 - 6.0 / (1.0 + np.exp(-10.0 * (SHARE - 0.5)))
"""The hall, cooler by 6 K by the evening."""


@pytest.mark.parametrize("seed", [0])
def test_what_falls_while_the_hall_gets_cooler_may_be_either(seed: int) -> None:
    hall = COOLER + 0.2 * np.sin(40.0 * SHARE)
    search, base, told = judged(1.0 - 0.35 * np.clip((SHARE - 0.3) / 0.4, 0.0, 1.0), hall, seed)
    assert [h.driver for h in told.effects] == ["hall"], "the catalogue of one record has no gradual changes"
    with np.errstate(all="ignore"):
        either = or_in_time(search, base, told)
    assert either.word == "class"
    assert [(h.site, h.driver) for h in either.effects] == [("rate", "hall"), ("rate", "time")]
    assert "smaller, gradually from" in told_in_words(search, either)


def test_what_follows_the_hall_up_and_down_does_depend_on_it() -> None:
    hall = 21.0 + 3.0 * np.sin(25.0 * SHARE)
    search, base, told = judged(1.0 + 0.05 * (hall - 21.0), hall, 2)
    assert [(h.site, h.driver) for h in told.effects] == [("rate", "hall")]
    with np.errstate(all="ignore"):
        assert or_in_time(search, base, told) is told
