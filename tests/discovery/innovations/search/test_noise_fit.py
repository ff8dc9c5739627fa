"""Two sizes of noise are found where a likelihood with a known minimum has it, in few runs of the filter."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.discovery.innovations.filter.noise_fit import RHO, THETA, Costs, search_noise, search_noise_along
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import LANES

ROWS = 600


class Likelihood:
    """Of a known truth: one half of the rows has the variance rho^2, the other one rho^2 + 9 theta^2."""

    def __init__(self, theta: float, rho: float) -> None:
        self.truth, self.calls = (rho**2, rho**2 + 9 * theta**2), 0

    def all(self, sizes: Sequence[tuple[float, float]]) -> list[float]:
        """Of several sizes, eight of which run side by side."""
        self.calls += -(-len(sizes) // LANES)
        return [self(*size) for size in sizes]

    def __call__(self, theta: float, rho: float) -> float:
        variances = rho**2, rho**2 + 9 * theta**2
        return float(ROWS / 4 * sum(np.log(v) + true / v for v, true in zip(variances, self.truth, strict=True)))

    @property
    def least(self) -> float:
        """The cost at the truth."""
        return float(ROWS / 4 * sum(np.log(true) + 1 for true in self.truth))


@settings(max_examples=60, deadline=None)
@given(st.floats(-6.0, 1.0), st.floats(-0.5, 1.0), st.booleans())
def test_the_least_cost_is_found_to_less_than_what_counts(log_theta: float, log_rho: float, near: bool) -> None:
    """An effect must gain 12: a search that ends 1.5 above the least decides nothing, nor a first one 3 above it."""
    theta, rho = float(np.exp(log_theta)), float(np.exp(log_rho))
    cost = Likelihood(theta, rho)
    found, least = search_noise(cost.all, (2 * theta, 0.8 * rho) if near else None)
    assert least == cost(*found)
    assert least - cost.least < (1.5 if near else 3.0)
    assert cost.calls <= 12


def test_a_search_that_is_called_again_looks_near_and_ends_where_the_other_does() -> None:
    again, anew = Likelihood(0.1, 1.0), Likelihood(0.1, 1.0)
    near, far = search_noise(again.all, (0.11, 0.95), near=True), search_noise(anew.all, (0.11, 0.95))
    assert near[1] == pytest.approx(far[1], abs=0.3)
    assert again.calls < anew.calls


@pytest.mark.parametrize("start", [None, (1e-6, 1.0), (10.0, 10.0)])
def test_sizes_stay_in_their_range(start: tuple[float, float] | None) -> None:
    (theta, rho), _ = search_noise(lambda sizes: [100 * (np.log(t) + np.log(r)) for t, r in sizes], start)
    assert (theta, rho) == pytest.approx((THETA[0], RHO[0]))


def along(cost: Likelihood, wrong: float = 0.0) -> Callable[[tuple[float, float]], Costs]:
    """Costs that are right at a pair; elsewhere they are lower by a share of how far away it is."""

    def at(middle: tuple[float, float]) -> Costs:
        def costs(sizes: Sequence[tuple[float, float]]) -> list[float]:
            return [cost(*size) - wrong * abs(float(np.log(size[0] / middle[0]))) for size in sizes]

        return costs

    return at


@settings(max_examples=60, deadline=None)
@given(st.floats(-6.0, 1.0), st.floats(-0.5, 1.0), st.floats(0.0, 200.0), st.booleans())
def test_costs_that_are_nearly_right_lead_to_the_same_noise(
    log_theta: float, log_rho: float, wrong: float, near: bool
) -> None:
    """However wrong they are: what they promise is tried, and where it is not there, the search does without them."""
    theta, rho = float(np.exp(log_theta)), float(np.exp(log_rho))
    cost = Likelihood(theta, rho)
    start = (2 * theta, 0.8 * rho) if near else None
    found, least = search_noise_along(cost.all, along(cost, wrong), start)
    assert least == pytest.approx(cost(*found))
    assert least - cost.least < 3.0


def test_right_costs_take_few_runs() -> None:
    cost = Likelihood(0.1, 1.0)
    _, least = search_noise_along(cost.all, along(Likelihood(0.1, 1.0)), (0.4, 1.3))
    assert least - cost.least < 1.0
    assert cost.calls <= 4
