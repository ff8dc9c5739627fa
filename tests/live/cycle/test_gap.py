"""A gap in the samples: what was known of the errors of the measurements is known after it, also in another process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.contracts import Estimate, Prior, Status
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link.replay import replay
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.store.memory import Memory, open_database
from adaptive_flot.live.store.rows import ESTIMATED, error_columns, known_of_errors
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.scenario.scenario import Scenario
from estimators.adaptive_imm.trust import NOT_WHITE
from tests.live.bench import INITIAL, Bench, as_told

LONGEST, AFTER = 5, 12
NUMBERS = arrays(float, 2, elements=st.floats(min_value=0, allow_nan=False))
COLOURED = np.array([30.0])


@given(noise=NUMBERS, colour=st.none() | NUMBERS, core=st.none() | NUMBERS)
def test_what_is_known_of_the_errors_comes_back_from_the_database_to_the_bit(
    noise: FloatArray, colour: FloatArray | None, core: FloatArray | None
) -> None:
    prior = Prior(0.0, np.zeros(1), np.zeros(1), np.eye(1), noise, colour=colour, core_noise_std=core)
    back = known_of_errors(error_columns(prior))
    assert set(back) == {name for name in ("noise_std", "colour", "core_noise_std") if getattr(prior, name) is not None}
    for name, value in back.items():
        assert value.tobytes() == getattr(prior, name).tobytes()


@pytest.fixture(scope="module", params=[DEFAULT_ESTIMATOR, "rpem"])
def gapped(request: pytest.FixtureRequest, write_link: Callable[..., Link], scenario: Scenario) -> tuple[Link, Cycle]:
    """A link for which a few missed intervals are a long gap."""
    link = write_link(scenario, {"controller": "pi", "estimator": request.param, "cycle.longest_gap_s": LONGEST})
    return link, Cycle(link)


def with_colour(bench: Bench) -> None:
    """The first record's errors are told to be coloured, and to have outliers."""
    estimation = bench.state.estimation
    assert estimation.began is not None
    known = replace(estimation.began, colour=COLOURED, core_noise_std=0.5 * estimation.began.noise_std)
    again = replace(estimation, began=known, inner=bench.cycle.estimation.estimator.init(known))
    bench.state = replace(bench.state, estimation=again)


def estimates(bench: Bench, intervals: int) -> list[Mapping[str, bytes]]:
    """The next estimates, but for their time: a link that starts counts it anew."""
    found = [outcome.estimate for outcome in bench.run(intervals)]
    return [{name: getattr(e, name).tobytes() for name in ESTIMATED} | {"status": e.status} for e in found if e]


@pytest.mark.parametrize(("before", "gap"), [(1, LONGEST + 2), (9, 40)])
def test_a_link_that_was_stopped_in_a_gap_goes_on_as_one_that_was_not(
    gapped: tuple[Link, Cycle], before: int, gap: int, tmp_path: Path
) -> None:
    """To the bit, and its replay too: also with a first record whose errors have a colour and outliers."""
    link, cycle = gapped
    bench = Bench(cycle, memory=Memory(open_database("sqlite:///gap.sqlite", tmp_path), link))
    bench.run(INITIAL + 1)
    with_colour(bench)
    bench.run(before)
    for _ in range(gap):
        bench.direct.interval()
    stopped = bench.copy(as_told)
    bench.memory = None
    stopped.restart(Memory(open_database("sqlite:///gap.sqlite", tmp_path), link))
    known = estimates(bench, AFTER)
    assert known == estimates(stopped, AFTER) and len(known) == AFTER
    again = stopped.state.estimation.began
    assert again is not None and again.ongoing and again.colour is not None and again.colour[0] == COLOURED[0]
    engine = open_database("sqlite:///gap.sqlite", tmp_path)
    assert replay(engine, link, 2).different == 0
    engine.dispose()


def test_after_a_gap_the_model_is_still_ruled_out(write_link: Callable[..., Link], scenario: Scenario) -> None:
    """And the region is that of the last estimate: the first record does not count twice."""
    link = write_link(scenario, {"controller": "pi", "estimator": ..., "cycle.longest_gap_s": LONGEST})
    bench = Bench(Cycle(link))
    bench.run(INITIAL + 1)
    with_colour(bench)
    last = bench.run(3)[-1].estimate
    for _ in range(LONGEST + 2):
        bench.direct.interval()
    after = bench.run(1)[-1].estimate
    assert last is not None and after is not None and COLOURED[0] > NOT_WHITE
    assert last.status is after.status is Status.MODEL_ERROR
    assert 0.5 < area(after) / area(last) < 2.0


def area(estimate: Estimate) -> float:
    """Of the region of the parameters."""
    return float(np.sqrt(np.linalg.det(estimate.covariance)))
