"""What is told beside what the free run has and does not tell: a class of both where they explain as much."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis, Kind
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import alternatives as asking
from adaptive_flot.greybox.effects import Effect
from tests.discovery.innovations.late_tank import LATE, model, record


def hypothesis(site: str, kind: Kind = "alternative", driver: str = "dose") -> Hypothesis:
    return Hypothesis(site, driver, kind, Effect(site, driver, "curve", settings={"knots": (0.0, 1.0)}), (), ({},))


@dataclass(frozen=True)
class Given:
    """An explanation whose criterion is given."""

    criterion: float
    hypotheses: tuple[Hypothesis, ...]


@dataclass
class Stand:
    """A search that fits what it is given."""

    known: dict[str, Given | None] = field(default_factory=dict)

    def of_effects(self, effects: Any, fitted: Any, names: Any) -> Given | None:
        return self.known[effects]


LIMIT = hypothesis("doser", "range", "saturation")
STORE = hypothesis("wash_out", "store", "residual")
CURVE = Effect("gains", "time", "curve", {"value_1": 0.0, "value_2": 1.0}, {"knots": (0.0, 1.0)})


def told(*hypotheses: Hypothesis, criterion: float = 100.0) -> Any:
    best: Any = Given(criterion, hypotheses)
    return Told("named", best, hypotheses, (), (best,), "")


def beside(said: Told, *others: Given | None, word: str = "abstain", contradiction: str = "") -> Told | None:
    """The answer where alternatives within 10 are not told apart."""
    named = [SimpleNamespace(effects=str(k), fit=SimpleNamespace(model=None, names=())) for k in range(len(others))]
    state: Any = SimpleNamespace(
        judged=SimpleNamespace(word=word),
        contradiction=contradiction,
        searched=(None, SimpleNamespace(alternatives=named)),
    )
    search: Any = Stand({str(k): e for k, e in enumerate(others)})
    base: Any = Given(0.0, ())
    return asking.beside_alternatives(state, search, base, said)


@pytest.fixture(autouse=True)
def _apart_by_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "told_apart", lambda search, base, best, other: best.criterion - other.criterion > 10)


def test_a_limit_and_a_curve_that_draws_it_are_a_class() -> None:
    said = beside(told(LIMIT), Given(97.0, (hypothesis("demand"),)), Given(60.0, (hypothesis("decay"),)))
    assert said is not None and said.word == "class"
    assert [h.site for h in said.effects] == ["doser", "demand"]


def test_a_curve_that_explains_less_leaves_the_name() -> None:
    said = told(LIMIT)
    assert beside(said, Given(60.0, (hypothesis("demand"),))) is said


def test_a_curve_at_the_place_that_is_told_is_the_same_part() -> None:
    said = told(LIMIT)
    assert beside(said, Given(99.0, (hypothesis("doser"),))) is said


def test_a_store_beside_a_fault_is_no_member() -> None:
    said = beside(told(LIMIT, STORE), Given(97.0, (hypothesis("demand"),)))
    assert said is not None and [h.site for h in said.effects] == ["doser", "demand"]


@pytest.mark.parametrize(
    "others",
    [
        (Given(120.0, (hypothesis("demand"),)),),
        (Given(97.0, (hypothesis("demand"), hypothesis("probe"))),),
        tuple(Given(97.0, (hypothesis(site),)) for site in ("demand", "decay", "probe")),
    ],
    ids=["explains more", "two effects", "too many places"],
)
def test_nothing_is_told_where_alternatives_do_more_or_are_many(others: tuple[Given, ...]) -> None:
    assert beside(told(LIMIT), *others) is None


def test_an_alternative_that_can_not_be_fitted_is_not_refuted() -> None:
    assert beside(told(LIMIT), None, Given(60.0, (hypothesis("demand"),))) is None


@pytest.mark.parametrize(("word", "contradiction"), [("named", ""), ("class", ""), ("abstain", "the error grows")])
def test_what_the_free_run_tells_or_has_taken_back_is_not_compared(word: str, contradiction: str) -> None:
    assert beside(told(LIMIT), Given(60.0, (hypothesis("demand"),)), word=word, contradiction=contradiction) is None


def test_an_effect_of_a_free_run_is_fitted_as_one_that_was_searched() -> None:
    """Reduction: the same lag, given with its fitted size, comes to the same likelihood and size."""
    search = Search(model(), record(0, 300, 0.0), (0,), np.array([0.01]), ("time",))
    base = search.base(model().parameter_values)
    found = next(e for e in best_explanations(search, base) if [h.label for h in e.hypotheses] == ["gauge lag"])
    fitted = search.model_of(found)
    again = search.of_effects(fitted.fitted_effects(), fitted, ("time", *found.free))
    assert again is not None
    assert again.criterion == pytest.approx(found.criterion, abs=0.5)
    assert search.model_of(again).parameters[-1].value == pytest.approx(LATE, rel=0.15)


@pytest.mark.parametrize(
    ("driver", "words"),
    [("saturation", "pump has a limit"), ("time", "pump changes with time"), ("u", "pump depends on u")],
)
def test_an_alternative_is_said_without_a_size(driver: str, words: str) -> None:
    assert words_of(model(), hypothesis("pump", driver=driver), lambda name: 0.0) == words


@pytest.mark.parametrize(("site", "word"), [("doser", "class"), ("demand", "nothing")])
def test_a_curve_that_explains_more_at_the_same_site_leaves_the_site(site: str, word: str) -> None:
    """It is the doser; whether it has a limit or depends on what is asked is not told. Elsewhere nothing is."""
    said = beside(told(LIMIT), Given(150.0, (hypothesis(site),)), Given(60.0, (hypothesis("decay"),)))
    assert (said.word if said is not None else "nothing") == word
    if said is not None:
        assert [(h.site, h.driver) for h in said.effects] == [("doser", "saturation"), ("doser", "dose")]


@pytest.mark.parametrize(("driver", "word"), [("dose", "named"), ("constant", "class"), ("time", "class")])
def test_two_forms_of_one_dependence_are_one_name(driver: str, word: str) -> None:
    """A loss that depends on the wind was told as a class of itself and itself. An offset and a gain are two causes."""
    said = beside(told(hypothesis("doser", "depends", driver)), Given(150.0, (hypothesis("doser", driver=driver),)))
    assert said is not None and said.word == word


def test_another_cause_there_that_explains_more_is_a_member_beside_a_better_form() -> None:
    better, other = Given(150.0, (hypothesis("doser"),)), Given(120.0, (hypothesis("doser", driver="time"),))
    said = beside(told(hypothesis("doser", "depends")), better, other)
    assert said is not None and [h.driver for h in said.effects] == ["dose", "time"]


@pytest.mark.parametrize(("criterion", "word"), [(97.0, "named"), (105.0, "class")])
def test_others_are_compared_with_the_better_form(criterion: float, word: str) -> None:
    better, other = Given(112.0, (hypothesis("doser"),)), Given(criterion, (hypothesis("demand"),))
    said = beside(told(hypothesis("doser", "depends")), better, other)
    assert said is not None and said.word == word


def test_a_curve_that_explains_more_with_something_else_leaves_nothing() -> None:
    assert beside(told(LIMIT), Given(150.0, (hypothesis("doser"), hypothesis("decay")))) is None


def among(
    monkeypatch: pytest.MonkeyPatch, *others: Given | None, sets: int = 1, contradiction: str = ""
) -> Told | None:
    """The answer where the best explanation is named: LIMIT, by 50, is what the innovations form has found."""

    def judged(search: Any, base: Any, found: Any) -> Told:
        best = found[0]
        return Told("named", best, best.hypotheses, (), (best,), "")

    monkeypatch.setattr(asking, "judge", judged)
    named = [
        SimpleNamespace(names=(("any", "time"),) * sets, effects=str(k), fit=SimpleNamespace(model=None, names=()))
        for k in range(len(others))
    ]
    state: Any = SimpleNamespace(
        judged=SimpleNamespace(word="abstain"),
        contradiction=contradiction,
        searched=(None, SimpleNamespace(alternatives=named)),
    )
    search: Any = Stand({str(k): e for k, e in enumerate(others)})
    base, found = Given(0.0, ()), Given(50.0, (LIMIT,))
    return asking.among_alternatives(state, search, base, [found])  # type: ignore[arg-type, list-item]


RAMP = Hypothesis("demand", "time", "alternative", Effect("demand", "time", "ramp"), (), ({},))
FREE = Hypothesis("demand", "time", "alternative", CURVE, (), ({},))


def test_an_effect_of_the_free_run_that_explains_more_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    said = among(monkeypatch, Given(90.0, (RAMP,)), Given(20.0, (hypothesis("decay"),)))
    assert said is not None and said.effects == (RAMP,)


@pytest.mark.parametrize(
    ("others", "settings"),
    [
        ((Given(40.0, (RAMP,)),), {}),
        ((Given(90.0, (FREE,)),), {}),
        ((Given(90.0, (RAMP,)), None), {}),
        ((Given(90.0, (RAMP, hypothesis("decay"))),), {"sets": 2}),
        ((Given(90.0, (RAMP,)),), {"contradiction": "the error grows"}),
    ],
    ids=["explains less", "free curve in time", "one can not be fitted", "several effects", "contradicted"],
)
def test_nothing_comes_of_effects_of_the_free_run_that(
    others: Any, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert among(monkeypatch, *others, **settings) is None
