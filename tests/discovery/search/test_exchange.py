"""Exchange: a wrong first effect gives way to the true one once the second is in place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from adaptive_flot.discovery.candidates.score_test import Scorer
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import MOST_STEPS, Fitter
from adaptive_flot.discovery.record.problem import make_problem
from adaptive_flot.discovery.results import Alternative, Round
from adaptive_flot.discovery.search import exchange
from adaptive_flot.discovery.search.alternatives import fit_variant
from adaptive_flot.discovery.search.exchange import with_exchanges, without
from adaptive_flot.discovery.search.rounds import run_round, scorer_of
from tests.discovery.heated import Truth, heated_tank, tank_record

DRAUGHT, READING, WRONG = ("heat_loss", "fan_speed"), ("thermometer", "time"), ("heat_loss", "time")


@pytest.fixture(scope="module")
def misled() -> tuple[Fitter, Fit, Round, Alternative]:
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
    return fitter, base, replace(second, alternatives=held), first


def test_the_true_first_effect_takes_the_place_of_a_wrong_one(
    misled: tuple[Fitter, Fit, Round, Alternative],
) -> None:
    fitter, base, latest, first = misled
    found = with_exchanges(fitter, base, latest, [first])
    assert set(found.alternatives[0].names) == {DRAUGHT, READING}
    assert found.alternatives[0].fit.bic < latest.alternatives[0].fit.bic - 100
    assert latest.alternatives[0] in found.alternatives


def test_each_effect_of_the_best_set_was_searched_beside_the_others(
    misled: tuple[Fitter, Fit, Round, Alternative], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second effect was found beside the wrong first one: once that is gone, it is searched again."""
    fitter, base, latest, first = misled
    beside = [set(first.names)]

    def seen(fitter: Fitter, base: Fit, scorers: list[Scorer], beam: list[Alternative | None], *rest: Any) -> Round:
        beside.extend(set(a.names) for a in beam if a is not None)
        return run_round(fitter, base, scorers, beam, *rest)

    monkeypatch.setattr(exchange, "run_round", seen)
    best = exchange.with_exchanges(fitter, base, latest, [first]).alternatives[0]
    assert all(set(best.names) - {name} in beside for name in best.names)
    assert len(beside) == len({frozenset(names) for names in beside}), "a set was searched twice"


def test_a_set_without_one_effect_is_a_fit_of_the_others(misled: tuple[Fitter, Fit, Round, Alternative]) -> None:
    """It lies between the model as it is and the whole set, as nested models do, and holds the other effect alone."""
    fitter, base, latest, _ = misled
    whole = latest.alternatives[0]
    for k, name in enumerate(reversed(whole.names)):
        rest = without(fitter, base, whole, k)
        assert rest is not None and rest.names == (name,)
        assert [(e.site, e.driver) for e in rest.effects] == [name]
        assert whole.fit.loss < rest.fit.loss < base.loss
