"""A controller goes on with the plan and the grade bias of one whose model had fewer states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.contracts import DelayedValue, Estimate, Status
from adaptive_flot.greybox import Model, steady_state
from controllers.economic_mpc.output_bias import OutputBias
from controllers.economic_mpc.problem.layout import StageLayout
from controllers.economic_mpc.taking_over import with_further_states
from tests.controllers.plan.test_collocation import HELD, LIMITS
from tests.controllers.plan.test_extended_models import GROWTH, LATE_FEED


def test_a_widened_plan_is_the_same_plan_with_the_further_states_held(model: Model) -> None:
    """Against the layout of the larger problem itself: what it lays out from the larger state."""
    extended = model.with_effects([GROWTH, LATE_FEED])
    small, large = StageLayout(model, LIMITS, 3, 30.0), StageLayout(extended, LIMITS, 3, 30.0)
    x, gas = steady_state(extended, HELD).state, np.array([0.01])
    moved = HELD[[0, 2]]
    before = small.start(x[: len(model.states)], moved, gas)
    expected = large.start(x, moved, gas)
    assert len(before) < len(expected)
    np.testing.assert_array_equal(with_further_states(before, small, large, x), expected)
    np.testing.assert_array_equal(
        large.inputs_of(with_further_states(before, small, large, x)), small.inputs_of(before)
    )


def estimate(time: float, innovation: float, delayed: float) -> Estimate:
    came = (DelayedValue("concentrate_grade", time - 3, delayed),) if np.isfinite(delayed) else ()
    nothing = np.empty(0)
    values = np.array([0.0, innovation])
    return Estimate(time, nothing, values, nothing, nothing, nothing, nothing, Status.OK, came)


VALUES = st.lists(st.tuples(*[st.floats(-1, 1)] * 4, st.booleans(), st.booleans()), min_size=1, max_size=20)


@given(VALUES)
def test_the_bias_changes_by_the_filtered_change_of_the_innovations(
    rows: list[tuple[float, float, float, float, bool, bool]],
) -> None:
    """Property: filtering other innovations from the same start on gives the old bias plus `change`; missing and
    delayed values come at the same samples, as they are the plant's."""
    bias = OutputBias("concentrate_grade", 1, 1.0, 20.0)
    known: list[Estimate] = []
    again: list[Estimate] = []
    for k, (old, new, delayed_old, delayed_new, seen, delayed) in enumerate(rows):
        for solution, now, after in ((known, old, delayed_old), (again, new, delayed_new)):
            solution.append(estimate(1.0 + k, now if seen else np.nan, after if delayed else np.nan))

    def filtered(estimates: list[Estimate]) -> float:
        value, heard = 0.3, 0.0
        for e in estimates:
            value, heard = bias.after(value, heard, e)
        return value

    assert filtered(again) - filtered(known) == pytest.approx(bias.change(known, again), abs=1e-12)
    assert bias.change(known, known) == 0.0
