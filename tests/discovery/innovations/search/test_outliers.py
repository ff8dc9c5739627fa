"""One row that is far off decides nothing about what is looked for: a Gaussian filter would believe it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.filter.refit import single_outliers
from adaptive_flot.discovery.innovations.screening import Screening
from adaptive_flot.discovery.innovations.search.search import Search
from tests.discovery.innovations.thermostat import model, record


@given(at=st.integers(0, 39), size=st.floats(5.1, 1e6), sign=st.sampled_from([-1.0, 1.0]))
def test_a_row_that_is_far_off_by_itself_is_an_outlier(at: int, size: float, sign: float) -> None:
    e = 0.5 * np.ones((40, 1))
    e[at] = sign * 2.0 * size
    assert np.flatnonzero(single_outliers(e, np.full((40, 1), 4.0))).tolist() == [at]


@pytest.mark.parametrize("rows", [2, 5])
def test_a_step_is_none_and_neither_is_what_is_missing(rows: int) -> None:
    """After a step the filter by Student's t is as far off for some rows."""
    e = np.zeros((40, 1))
    e[10 : 10 + rows] = 30.0
    e[20] = np.nan
    assert not single_outliers(e, np.ones((40, 1))).any()


@pytest.mark.parametrize("wrong", ["periodic", "hysteresis"])
def test_the_suspects_are_the_same_with_an_outlier(wrong: str) -> None:
    data, plain = record(wrong), model()  # type: ignore[arg-type]
    search = Search(plain, data, (0,), noise_floor([data], (0,)), ("conductance", "capacity"))
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        gains = []
        for off in (0.0, 5.0):
            data.outputs[250, 0] += off  # 160 times the measurement noise
            fit = search.fitter(plain, ()).at(base.fit.p)
            response = search.fitter(plain, ()).response(fit, [s.name for s in plain.sites])
            gains.append(
                {s.suspect.hypothesis.label: s.gain for s in reversed(Screening(plain, response).all(events=True))}
            )
    best = max(gains[0], key=lambda name: gains[0][name])
    assert max(gains[1], key=lambda name: gains[1][name]) == best
    assert gains[1][best] == pytest.approx(gains[0][best], rel=0.1)
