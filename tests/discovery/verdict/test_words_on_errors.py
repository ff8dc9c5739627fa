"""Protects readers from errors that say nothing, and from constants at an end of their range that nobody mentions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.results import OutputChange, Verdict
from adaptive_flot.discovery.results.words import NO_SITE, NOTHING_ADDED
from adaptive_flot.discovery.stages import at_the_end_of_their_range
from adaptive_flot.greybox import Model
from tests.discovery.heated import heated_tank


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (1.44, 0.0865, "brix 1.44 -> 0.0865 pct"),
        (1.44e20, 0.0865, "brix runs away -> 0.0865 pct"),  # the free run emptied the tank
        (1.44e20, 1.44e20, "brix runs away pct"),
    ],
)
def test_a_run_that_leaves_all_bounds_has_no_number(before: float, after: float, words: str) -> None:
    assert OutputChange("brix", "pct", before, after, 2.8, (0.9, 1.0)).words == words


@pytest.mark.parametrize(
    ("reason", "after", "said"),
    [
        (f"It is as if a leak: {NO_SITE}.", 0.2, True),
        (f"It is as if a leak: {NO_SITE}.", 0.1, False),
        ("none", 0.2, False),
    ],
)
def test_why_errors_are_the_same_is_said_beside_what_has_no_site(reason: str, after: float, said: bool) -> None:
    """A volume of 0.69 times was told over a table that read as if that explained nothing."""
    verdict = Verdict("abstain", reason, error=(OutputChange("level", "m", 0.2, after, 0.1, (0.0, 0.0)),))
    assert verdict.about_errors == (NOTHING_ADDED if said else "")


def fit(model: Model, **values: float) -> Any:
    return SimpleNamespace(model=model, names=tuple(values), values=np.array(list(values.values())))


def test_a_constant_at_an_end_of_its_range_is_said() -> None:
    """A leak whose constant was fitted at 0 could not open: a pressure gauge stood first, and nothing said why."""
    model = heated_tank()
    assert at_the_end_of_their_range(fit(model, efficiency=0.8, loss=80.0)) == ()
    (said,) = at_the_end_of_their_range(fit(model, efficiency=1.0, loss=80.0))
    assert said.startswith("efficiency is fitted at the upper end of its range, 1: widen the range")
    parameters = tuple(replace(p, lower=0.0) if p.name == "loss" else p for p in model.parameters)
    (said,) = at_the_end_of_their_range(fit(replace(model, parameters=parameters), efficiency=0.8, loss=0.0))
    assert "0, so that nothing that it multiplies can change: give it a lower end above zero" in said
