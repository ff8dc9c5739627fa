"""Checks of a controller."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import Status
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.testing.cases import ControllerCase, run_controller
from adaptive_flot.testing.comparing import assert_frozen, same


def check_controller_state_is_frozen(case: ControllerCase) -> None:
    """The state is a frozen dataclass."""
    assert_frozen(case.controller.init(0.0))


def check_controller_decides_within_bounds(case: ControllerCase) -> None:
    """Inputs are finite and within the model's range, from the first decision on, also without a measurement."""
    lost = replace(case.samples[-1], outputs=np.full_like(case.samples[-1].outputs, np.nan))
    blind = replace(case.estimates[-1], innovation=lost.outputs, status=Status.MISSING)
    samples, estimates = [None, *case.samples, lost], [None, *case.estimates, blind]
    _, decisions = run_controller(case, case.controller.init(0.0), samples, estimates)
    for decision in decisions:
        try:
            case.setup.model.check_inputs(decision.inputs)
        except AdaptiveFlotError as error:
            raise AssertionError(f"a decision is outside the model's range: {error}") from error
        assert decision.decided_by, "a decision says who took it"


def check_controller_is_deterministic_and_resumable(case: ControllerCase) -> None:
    """The same samples give the same inputs to the bit, also from a pickled state in the middle."""
    samples, estimates = [None, *case.samples], [None, *case.estimates]
    _, whole = run_controller(case, case.controller.init(0.0), samples, estimates)
    middle, first = run_controller(case, case.controller.init(0.0), samples[:7], estimates[:7])
    _, rest = run_controller(case, pickle.loads(pickle.dumps(middle)), samples[7:], estimates[7:])
    assert same([d.inputs for d in whole], [d.inputs for d in (*first, *rest)]), "decisions differ after a resume"


def check_controller_inputs_are_not_changed(case: ControllerCase) -> None:
    """Setup, state and sample are the same after a decision; the decision aliases none of them."""
    state = case.controller.init(0.0)
    kept = copy.deepcopy((state, case.samples, case.estimates, case.setup.schedule))
    after, decision = case.controller.decide(state, case.samples[0], case.estimates[0])
    later = copy.deepcopy(after)
    decision.inputs[:] = 0.0
    assert same(kept, (state, case.samples, case.estimates, case.setup.schedule)), "a decision changed its arguments"
    assert same(later, after), "the decision aliases the state"


CONTROLLER_CHECKS: tuple[Callable[[ControllerCase], None], ...] = (
    check_controller_state_is_frozen,
    check_controller_decides_within_bounds,
    check_controller_is_deterministic_and_resumable,
    check_controller_inputs_are_not_changed,
)
