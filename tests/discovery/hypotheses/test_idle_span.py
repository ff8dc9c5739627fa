"""Protects: a gauge that is off by the same everywhere is told as that, and not as one with a wrong span."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.judgement import Judged, _offset_of_idle_span, has_idle_span
from adaptive_flot.greybox import Effect

SPAN = Hypothesis(
    "gauge", "own_value", "span", Effect("gauge", "own_value", "span", {}, {"middle": 1.0}), ("offset", "slope"), ({},)
)
OFFSET = Hypothesis("gauge", "constant", "offset", Effect("gauge", "constant", "shift"), ("amplitude",), ({},))


def stand_in(hypothesis: Hypothesis, total: float, values: tuple[float, ...], spread: tuple[float, ...]) -> Any:
    """A stand-in of a hypothesis that was fitted and tested."""
    known = dict(zip(hypothesis.parameters, values, strict=True))
    fit = SimpleNamespace(value=known.__getitem__, coefficients=values)
    return SimpleNamespace(hypothesis=hypothesis, total=total, fit=fit, spread=np.array(spread))


@pytest.mark.parametrize(("slope", "told"), [(0.01, OFFSET), (-0.019, OFFSET), (0.03, SPAN)])
def test_a_slope_of_less_than_its_uncertainty_is_none(slope: float, told: Hypothesis) -> None:
    span = stand_in(SPAN, -1000.0, (0.5, slope), (0.01, 0.01))
    offset = stand_in(OFFSET, 0.0, (0.5,), (0.01,))
    assert has_idle_span(span) is (told is OFFSET) and not has_idle_span(offset)
    (first,) = Judged("named", span, (offset,), "", 1.0).parts
    assert first.hypothesis is told
    # where no offset comes near, there is no other name for it
    (alone,) = Judged("named", span, (), "", 1.0).parts
    assert alone.hypothesis is SPAN


@pytest.mark.parametrize(("slope", "same"), [(0.01, True), (0.03, False)])
def test_an_offset_whose_fit_rests_a_little_beside_is_the_same_as_an_idle_span(slope: float, same: bool) -> None:
    """A grade sensor that showed 0.06 too much was told with "a span 0 % larger": its offset rested beside."""
    span = stand_in(SPAN, -1000.0, (0.5, slope), (0.01, 0.01))
    offset = stand_in(OFFSET, -900.0, (0.47,), (0.01,))
    assert _offset_of_idle_span(span, (), [span, offset]) == ((offset,) if same else ())
    assert not _offset_of_idle_span(span, (offset,), [span, offset])  # it is among those alike
    assert not _offset_of_idle_span(offset, (), [span, offset])
