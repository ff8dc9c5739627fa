"""Exchange: a wrong first effect gives way to the true one once the second is in place."""

from __future__ import annotations

from dataclasses import replace

import pytest

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.discovery.search.alternatives import fit_variant
from adaptive_flot.discovery.search.exchange import with_exchanges, without
from adaptive_flot.discovery.search.rounds import run_round, scorer_of
from tests.discovery.heated import Truth, heated_tank, tank_record

DRAUGHT, READING, WRONG = ("heat_loss", "fan_speed"), ("thermometer", "time"), ("heat_loss", "time")


@pytest.fixture(scope="module")
def misled() -> tuple[Fitter, Fit, Round]:
    """A draught, and a thermometer that reads 3 K too much from the middle on; the search began with a loss in time."""
    problem = make_problem(tank_record(Truth(offset=3.0)), heated_tank(), ("efficiency", "loss"), burn_in=30, guard=5)
    fitter = Fitter(problem)
    base = fitter.fit(heated_tank())
    assert base is not None
    scorer, _ = scorer_of(problem, base)
    score = next(s for s in scorer.scores() if s.candidate.name == WRONG)
    fit = fit_variant(fitter, base, score, MOST_STEPS)
    assert fit is not None
    first = Alternative((WRONG,), (True,), fit, base.loss - fit.loss, fit.bic - base.bic)
    second = run_round(fitter, base, [scorer_of(problem, fit)[0]], [first])
    held = tuple(a for a in second.alternatives if set(a.names) == {WRONG, DRAUGHT})
    return fitter, base, replace(second, alternatives=held)


def test_the_true_first_effect_takes_the_place_of_a_wrong_one(misled: tuple[Fitter, Fit, Round]) -> None:
    fitter, base, latest = misled
    found = with_exchanges(fitter, base, latest)
    assert set(found.alternatives[0].names) == {DRAUGHT, READING}
    assert found.alternatives[0].fit.bic < latest.alternatives[0].fit.bic - 100
    assert latest.alternatives[0] in found.alternatives


def test_a_set_without_one_effect_is_a_fit_of_the_others(misled: tuple[Fitter, Fit, Round]) -> None:
    """It lies between the model as it is and the whole set, as nested models do, and holds the other effect alone."""
    fitter, base, latest = misled
    whole = latest.alternatives[0]
    for k, name in enumerate(reversed(whole.names)):
        rest = without(fitter, base, whole, k)
        assert rest is not None and rest.names == (name,)
        assert [(e.site, e.driver) for e in rest.effects] == [name]
        assert whole.fit.loss < rest.fit.loss < base.loss
