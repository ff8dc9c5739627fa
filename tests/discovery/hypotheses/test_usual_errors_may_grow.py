"""Protects: an output that stays as wrong as on the reference does not speak against a fault."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.comparison import AT_USUAL, Blocks, worse_outputs

ROWS = 200
BLOCKS = Blocks(tuple((0, a, a + 20) for a in range(0, ROWS, 20)))
SIGNS = np.where(np.arange(ROWS) % 2, 1.0, -1.0)


def errors_of(*sizes: float) -> SimpleNamespace:
    """Errors whose root mean square is each of the sizes, in every block."""
    return SimpleNamespace(fresh=[SIGNS[:, None] * np.array(sizes)])


def worse(grows: float, usual: tuple[float, float] | None) -> tuple[int, ...]:
    """Outputs that are worse where the first falls from 7 to 1, and the second grows from 1."""
    rows = SimpleNamespace(counted=[np.ones(ROWS, dtype=bool)])
    given = None if usual is None else np.array(usual)
    return worse_outputs(rows, BLOCKS, errors_of(7.0, 1.0), errors_of(1.0, grows), given)  # type: ignore[arg-type]


@pytest.mark.parametrize("grows", [1.03, 1.2])
def test_without_a_reference_what_grows_surely_is_worse(grows: float) -> None:
    assert worse(grows, None) == (1,)


def test_what_is_usual_on_the_reference_may_grow() -> None:
    assert worse(1.03, (1.0, 1.0)) == ()
    assert worse(0.99 * AT_USUAL, (1.0, 1.0)) == ()


def test_what_leaves_the_usual_is_worse() -> None:
    assert worse(1.01 * AT_USUAL, (1.0, 1.0)) == (1,)
    assert worse(1.03, (1.0, 0.5)) == (1,)


def test_nothing_usual_is_known_of_an_output_that_the_reference_lacks() -> None:
    assert worse(1.2, (1.0, float("nan"))) == (1,)
