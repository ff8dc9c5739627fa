"""An effect that every explanation has is told alone, where two are needed and the second is open."""

from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import common
from tests.discovery.innovations.verdicts.test_alternatives import Given, hypothesis

LAG, LEAK, DRIFT = (hypothesis(site) for site in ("probe", "doser", "demand"))
NAME = ("probe", "dose")


class Near(SimpleNamespace):
    """An alternative of the free run that is near the best one, or not."""

    def near(self, best: Any, margin: float) -> bool:
        return bool(self.worse < margin)


def free_run(*others: tuple[tuple[tuple[str, str], ...], float], word: str = "abstain", contradiction: str = "") -> Any:
    """Its state, with the best one of two effects, and others by how much worse they are; 10 is the margin."""
    best = Near(names=(NAME, ("doser", "dose")), worse=0.0)
    alternatives = [best, *(Near(names=names, worse=worse) for names, worse in others)]
    return SimpleNamespace(
        judged=SimpleNamespace(word=word, best=best),
        contradiction=contradiction,
        searched=(None, SimpleNamespace(alternatives=alternatives, rows_per_effective_sample=1.0)),
    )


@pytest.mark.parametrize(
    ("others", "settings", "holds"),
    [
        ((), {}, True),
        (((((NAME, ("demand", "time"))), 5.0),), {}, True),
        ((((("doser", "dose"), ("demand", "time")), 5.0),), {}, False),
        ((((("doser", "dose"), ("demand", "time")), 50.0),), {}, True),  # not near
        ((((NAME,), 5.0),), {}, False),  # nothing more is needed there: it is no part
        ((), {"word": "class"}, False),
        ((), {"contradiction": "the error grows"}, False),
    ],
)
def test_it_is_in_all_that_is_near(others: Any, settings: dict[str, str], holds: bool) -> None:
    assert common.in_all_that_is_near(free_run(*others, **settings), [NAME]) is holds


@pytest.mark.parametrize(
    ("alone", "without", "elsewhere", "told"),
    [
        (80.0, 40.0, 60.0, ["probe"]),
        (80.0, 75.0, 60.0, ["probe", "doser"]),  # the other one alone is as good
        (80.0, 40.0, 78.0, ["probe", "doser"]),  # so is a third one
    ],
)
def test_one_of_two_is_told_alone_where_nothing_without_it_is_as_good(
    alone: float, without: float, elsewhere: float, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Explanations within 10 are not told apart."""
    monkeypatch.setattr(common, "told_apart", lambda search, base, best, other: best.criterion - other.criterion > 10)
    best: Any = Given(100.0, (LAG, LEAK))
    one, two, three = Given(alone, (LAG,)), Given(without, (LEAK,)), Given(elsewhere, (DRIFT,))
    search: Any = SimpleNamespace(without=lambda explanation, h: one if h is LEAK else two)
    found: Any = [best, one, two, three]
    base: Any = Given(0.0, ())
    said = common.one_that_all_have(free_run(), search, base, found, Told("named", best, (LAG, LEAK), (), (best,), ""))
    assert [h.site for h in said.certain] == told
    assert said.best is (one if told == ["probe"] else best)
