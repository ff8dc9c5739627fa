"""Protects: since a reference, the first effect is looked for beside the constants of the reference as well.

Without it they have moved to make up for it. A thermometer 2.5 K off had moved four of them, and no regression beside
these saw it, though with it the record was likelier by e^346.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.screening import Screened
from adaptive_flot.discovery.innovations.search import beam
from adaptive_flot.discovery.innovations.search.beam import CONSTANT, held_at_the_reference, screened_beside
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox import Dataset
from tests.discovery.innovations.thermostat import CAPACITY, LOSS, model, record

NAMES = ("conductance", "capacity")


def since_a_reference(data: Dataset) -> tuple[Search, Explanation]:
    """A search with constants that a reference tells to 10 %, and the model as it is."""
    plain = model()
    mean = np.array([LOSS, CAPACITY])
    known = Constants(NAMES, mean, np.diag(0.1 * mean))
    p = plain.parameter_values
    p[list(plain.indices("parameters", NAMES))] = mean
    plain = plain.with_parameters({q.name: float(v) for q, v in zip(plain.parameters, p, strict=True)})
    search = Search(plain, data, (0,), noise_floor([data], (0,)), NAMES, known, since_reference=True)
    with np.errstate(all="ignore"):
        return search, search.base(p)


def too_warm(by: float) -> Dataset:
    """A healthy record whose thermometer shows too much, from the first row on."""
    data = record("nothing")
    outputs = data.outputs + by
    return Dataset(data.name, data.time, data.dt, data.inputs, outputs)


def test_the_regression_beside_the_reference_holds_its_constants_and_the_noise_of_the_record() -> None:
    search, base = since_a_reference(too_warm(2.0))
    held = held_at_the_reference(search, base)
    where = list(search.model.indices("parameters", NAMES))
    np.testing.assert_array_equal(held.fit.p, search.model.parameter_values)
    assert not np.allclose(base.fit.p[where], held.fit.p[where], rtol=1e-3), "the fit has moved them"
    assert held.fit.noise == base.fit.noise and held.hypotheses == ()


@pytest.mark.parametrize("by", [2.0, -3.0])
def test_every_constant_change_that_it_sees_is_refitted(monkeypatch: pytest.MonkeyPatch, by: float) -> None:
    """Two effects of a site at most are refitted beside a fit: what is there all the time is not left out for that."""
    search, base = since_a_reference(too_warm(by))
    refitted: list[Screened] = []

    def noted(self: Search, start: Explanation, chosen: Sequence[Screened], held: object = None) -> list[Explanation]:
        if held is not None:
            refitted.extend(chosen)
        return []

    monkeypatch.setattr(Search, "all_with", noted)
    with np.errstate(all="ignore"):
        beam._further(search, base)
        seen = screened_beside(search, held_at_the_reference(search, base))[1]
    constant = {
        s.suspect.hypothesis.label for s in seen if s.suspect.hypothesis.kind in CONSTANT and s.gain >= LEAST_GAIN
    }
    assert any("thermometer" in label or "offset" in label for label in constant), "the true one is among them"
    assert constant <= {s.suspect.hypothesis.label for s in refitted}
