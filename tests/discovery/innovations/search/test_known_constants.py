"""A constant that is known before does not take up what has changed: screening weighs it as the refit does."""

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from tests.discovery.innovations.thermostat import CAPACITY, LOSS, model, record

NAMES = ("conductance", "capacity")


def _gains(wrong_by: float, sd: float | None) -> tuple[dict[str, float], Explanation, Search]:
    """Gain of each suspect where the reference has said a conductance that is off by a factor, as surely as `sd`."""
    data, plain = record("nothing"), model()
    mean = np.array([wrong_by * LOSS, CAPACITY])
    known = None if sd is None else Constants(NAMES, mean, np.diag([sd * LOSS, 0.05 * CAPACITY]))
    search = Search(plain, data, (0,), noise_floor([data], (0,)), NAMES, known)
    start = plain.parameter_values
    start[list(plain.indices("parameters", NAMES))] = mean
    with np.errstate(all="ignore"):
        base = search.base(start)
        screened = search.screening(base, [s.name for s in plain.sites]).all(events=False)
    return {s.suspect.hypothesis.label: s.gain for s in reversed(screened)}, base, search


def test_a_loss_that_has_changed_by_a_third_shows_where_it_was_known() -> None:
    """Known within 1 %, the loss of the record is another one. Not known, it is a constant to be fitted."""
    known, *_ = _gains(1 / 1.5, 0.01)
    unknown, *_ = _gains(1 / 1.5, None)
    assert known["loss offset"] > 20 or known["loss depends by plate"] > 20, known
    assert unknown["loss depends by plate"] < 5, unknown


def test_a_loss_as_it_was_does_not() -> None:
    gains, *_ = _gains(1.0, 0.01)
    assert gains["loss depends by plate"] < 5, gains


def test_known_rows_are_the_prior_of_the_refit() -> None:
    """Half the sum of squares of the rows, at any step from the fit, is what the refit's cost adds for the prior."""
    _, base, search = _gains(1 / 1.5, 0.05)
    fitter = search.fitter(search.model, ())
    slopes, told = fitter.space.known_rows(base.fit.p)
    step = np.array([0.1, -20.0])
    p = base.fit.p.copy()
    p[list(search.model.indices("parameters", NAMES))] += step
    x = p[list(search.model.indices("parameters", NAMES))]
    assert search.known is not None
    prior = np.linalg.solve(search.known.root, x - search.known.mean)
    np.testing.assert_allclose(told - slopes @ step, -prior, rtol=1e-9)
