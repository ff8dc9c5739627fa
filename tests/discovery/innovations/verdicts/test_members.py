"""What a class of the innovations form has on its page: its members, their sizes, and the test between them."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.innovations.verdicts.members import alternative, others
from adaptive_flot.report.discovery.page import discovery_report
from adaptive_flot.report.discovery.tables import not_told_apart
from tests.discovery.innovations.thermostat import LAMP, model, record


def test_a_class_has_its_other_members_beside_it_and_says_that_no_test_tells_them_apart() -> None:
    """A lamp beside the plate: what the element gives too much, or the loss too little, is the same record."""
    found = discover(model(), record("lamp"))
    verdict = found.verdict
    assert verdict.word == "class" and found.by_process_noise and found.judgement is not None
    assert {site for site, _ in verdict.members} == {"other_heat", "element", "loss"}
    told = {found.judgement.best.names, *(a.names for a in found.judgement.rivals)} if found.judgement.best else set()
    assert told == {((site, "constant"),) for site in ("other_heat", "element", "loss")}
    # the size in the table is that of the sentence
    (effect,) = verdict.effects
    low, high = effect.interval95["amplitude"]
    size = effect.effect.coefficients["amplitude"]
    assert f"{abs(size):.3g} W too" in verdict.reason
    assert abs(size) == pytest.approx(LAMP, rel=0.1)
    assert min(abs(low), abs(high)) < LAMP < max(abs(low), abs(high))
    # nothing is said to be told apart that is not
    assert all("both with process noise" in said for said in not_told_apart(found)) and len(not_told_apart(found)) == 2
    assert verdict.experiment is not None and not verdict.experiment.tells
    page = discovery_report(found, "plate")
    assert "fitted with process noise, on all rows" in page and "comes near the best" not in page


def _explanation(rows: list[float], criterion: float, site: str = "valve") -> Any:
    h = SimpleNamespace(site=site, driver="constant")
    return SimpleNamespace(hypotheses=(h,), criterion=criterion, fit=SimpleNamespace(rows=np.array(rows)))


def test_the_deviation_of_a_criterion_is_that_of_sums_over_blocks() -> None:
    """Leads of 0 and 1 in turn, block by block: four sums with a deviation of 6 each, twice their root."""
    best, other = _explanation(([0.0] * 12 + [1.0] * 12) * 2, 100.0), _explanation([0.0] * 48, 95.0)
    fit, before = (SimpleNamespace(loss=v, bic=v) for v in (30.0, 50.0))
    made = alternative(other, fit, before, best)  # type: ignore[arg-type]
    assert made.loglik_difference_sd == pytest.approx(2 * np.sqrt(4) * 6)
    assert made.worse_than(alternative(best, fit, before, best)) == pytest.approx(10.0)  # type: ignore[arg-type]
    assert (made.gain, made.delta_bic) == (20.0, -20.0)


def test_a_member_that_a_free_run_can_not_be_fitted_for_is_left_out() -> None:
    best, one, two = (_explanation([0.0] * 48, 1.0, site) for site in ("valve", "pump", "duct"))
    fit: Any = SimpleNamespace(loss=1.0, bic=1.0)
    found = others(best, [best, one, two], lambda e: fit if e is one else None, fit)
    assert [a.names for a in found] == [(("pump", "constant"),)]


def test_other_sizes_leave_the_rest_of_a_fit_as_it_was() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(3, 3))
    rest: dict[str, Any] = {f.name: np.zeros((1, 1)) for f in fields(Fit)}
    given = {"model": model(), "names": ("conductance", "capacity", "x"), "values": np.array([1.0, 2.0, 3.0])}
    fit = Fit(**rest | given | {"covariance": root @ root.T})
    other = fit.with_sizes({"capacity": 500.0}, np.array([[4.0]]))
    np.testing.assert_array_equal(other.values, [1.0, 500.0, 3.0])
    assert other.model.parameters[other.model.index("parameters", "capacity")].value == 500.0
    np.testing.assert_array_equal(other.covariance[1], [0.0, 4.0, 0.0])
    np.testing.assert_array_equal(other.covariance[np.ix_([0, 2], [0, 2])], fit.covariance[np.ix_([0, 2], [0, 2])])
    assert fit.values[1] == 2.0 and fit.covariance[0, 1] != 0
