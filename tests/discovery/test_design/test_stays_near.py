"""Protects: a proposed test brings no output out of its physical range, nor far beyond where the record has been."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.test_design.separation import BEYOND, stays_near


def _asks(low: float, high: float, outputs: list[float], physical: tuple[float, float]) -> bool:
    measured = np.linspace(low, high, 401)[:, None]
    problem = SimpleNamespace(measured=measured, columns=(0,))
    model = SimpleNamespace(outputs=(SimpleNamespace(lower=physical[0], upper=physical[1]),))
    return stays_near(problem, model, np.array(outputs)[:, None])  # type: ignore[arg-type]


def test_an_axis_is_not_driven_out_of_its_rail() -> None:
    """A step of the force for 45 s brought it to 9 m. Its rail ends at 0.4 m, the record at 0.25 m."""
    assert _asks(0.0, 0.25, [0.1, 0.3], (-0.1, 0.4))
    assert not _asks(0.0, 0.25, [0.1, 0.41], (-0.1, 0.4))  # beyond the rail
    assert not _asks(0.0, 0.25, [0.1, 9.16], (-np.inf, np.inf))  # where it has never been
    assert not _asks(0.0, 0.25, [0.1, float("nan")], (-1.0, 1.0))


@given(width=st.floats(0.01, 100.0), share=st.floats(-0.9, 0.9))
def test_within_the_width_of_the_record_about_it_is_near(width: float, share: float) -> None:
    edge = share * BEYOND * width
    assert _asks(0.0, width, [-abs(edge), width + abs(edge)], (-np.inf, np.inf))
    assert not _asks(0.0, width, [width + 1.1 * BEYOND * width], (-np.inf, np.inf))
