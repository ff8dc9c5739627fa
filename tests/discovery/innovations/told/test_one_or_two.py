"""Two effects stand for one only where they explain so much more, and one that is worth more is told apart by that."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.innovations import telling_apart
from adaptive_flot.discovery.innovations.search.explanation import LEAST_GAIN, worth

ROWS = 240


def explanation(effects: int, gain: float, seed: int = 0) -> Any:
    """So many effects that gain so much, evenly over the rows but for a little; no numbers were fitted."""
    rows = np.full(ROWS, gain / ROWS) + 0.01 * np.random.default_rng(seed).standard_normal(ROWS)
    return SimpleNamespace(
        hypotheses=("effect",) * effects, criterion=gain, numbers=0, fit=SimpleNamespace(rows=rows)
    )  # fmt: skip


def test_each_effect_is_charged_with_what_it_must_gain_in_the_search() -> None:
    assert worth(explanation(1, 100.0)) == 100.0 - LEAST_GAIN
    assert worth(explanation(2, 100.0 + LEAST_GAIN)) == worth(explanation(1, 100.0))


@pytest.mark.parametrize(("gain", "apart"), [(90.0, True), (100.0, True), (108.0, False)])
def test_a_pair_that_gains_little_more_is_no_rival_of_one_effect(
    monkeypatch: pytest.MonkeyPatch, gain: float, apart: bool
) -> None:
    monkeypatch.setattr(telling_apart, "_adequate", lambda search, e: True)
    search: Any = SimpleNamespace()
    one, base = explanation(1, 100.0), explanation(0, 0.0)
    assert telling_apart.told_apart(search, base, one, explanation(2, gain, seed=1)) == apart
