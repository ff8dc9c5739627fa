"""When the innovations form is asked, and what its name must beat: judgements that are given, not searched."""

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.hypotheses.families import FOREVER, Hypothesis
from adaptive_flot.discovery.hypotheses.judgement import WithoutSite
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import rivals, telling
from adaptive_flot.discovery.innovations.verdicts import second_opinion as asking
from adaptive_flot.discovery.results import Judgement, OutputChange, State
from adaptive_flot.discovery.results.words import NO_SITE
from adaptive_flot.greybox.effects import Effect
from tests.discovery.innovations.box import model

CURVE = Effect("gains", "time", "curve", {"value_1": 0.0, "value_2": 1.0}, {"knots": (0.0, 1.0)})
STEP = Effect("gains", "time", "step", {"amplitude": 1.0, "onset": 5.0}, {"width": 2.0})
LAW = Effect("gains", "sun", "curve", {"value_1": 0.0, "value_2": 1.0}, {"knots": (0.0, 1.0)})


def state(word: str, effect: Effect, contradiction: str = "") -> Any:
    best = SimpleNamespace(effects=(effect,), names=((effect.site, effect.driver),))
    return SimpleNamespace(judged=SimpleNamespace(word=word, best=best), contradiction=contradiction)


@pytest.mark.parametrize(
    ("word", "effect", "asked"),
    [
        ("named", CURVE, True),
        ("class", CURVE, True),
        ("none", CURVE, False),
        ("named", STEP, False),
        ("named", LAW, False),
    ],
)
def test_a_free_curve_in_time_that_is_told_asks_for_a_second_opinion(word: str, effect: Effect, asked: bool) -> None:
    assert rivals.follows_time(state(word, effect)) == asked


@pytest.mark.parametrize("contradiction", ["", "on held-out rows it makes the error larger"])
def test_what_is_not_told_is_asked_contradicted_or_not(contradiction: str) -> None:
    assert asking.is_asked(state("abstain", LAW, contradiction)) and asking.is_asked(state("unnamed", LAW))


@pytest.mark.parametrize(
    ("given", "competes"),
    [
        (state("named", LAW), True),
        (state("abstain", LAW), True),
        (state("abstain", CURVE), False),
        (state("abstain", LAW, "on held-out rows it makes the error larger"), False),
    ],
)
def test_the_best_of_an_abstention_must_leave_the_larger_error_too(given: Any, competes: bool) -> None:
    assert rivals.competes(given) == competes


@pytest.mark.parametrize(
    ("gain", "pulses", "told"),
    [
        (99.0, ((2000.0, FOREVER),), False),
        (101.0, ((2000.0, FOREVER),), True),
        (50.0, ((2000.0, 300.0),), True),
        (50.0, ((2000.0, 300.0), (4000.0, FOREVER)), True),
    ],
)
def test_a_small_change_that_lasts_to_the_end_may_be_what_wanders(
    gain: float, pulses: tuple[tuple[float, float], ...], told: bool
) -> None:
    """What ends again, or comes several times, is no trend."""
    base, best = SimpleNamespace(criterion=10.0), SimpleNamespace(criterion=10.0 + gain)
    given = Told("named", best, (SimpleNamespace(kind="switch", pulses=pulses),), (), (), "")  # type: ignore[arg-type]
    assert (rivals.unless_a_trend(base, given).word == "named") == told  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("form", "gain", "told"),
    [("step", 99.0, False), ("step", 101.0, True), ("washout", 99.0, False), ("shift", 50.0, True)],
)
def test_an_event_of_the_free_run_is_asked_the_same(form: str, gain: float, told: bool) -> None:
    """Reduction: the rule on trends, for an event that is an alternative of the free run; a constant is none."""
    effect = Effect("gains", "time" if form != "shift" else "constant", form)
    base, best = SimpleNamespace(criterion=10.0), SimpleNamespace(criterion=10.0 + gain)
    given = Told("named", best, (Hypothesis("gains", effect.driver, "alternative", effect, (), ({},)),), (), (), "")  # type: ignore[arg-type]
    assert (rivals.unless_a_trend(base, given).word == "named") == told  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("word", "there", "known"),
    [
        ("unnamed", ("gains", "sun"), True),
        ("unnamed", ("gains", "lag"), False),
        ("named", ("gains", "lag"), True),
        ("named", ("loss", "sun"), False),
        ("class", ("loss", "sun"), True),
    ],
)
def test_a_name_stays_at_its_site_and_a_curve_without_one_only_as_that_curve(
    word: Any, there: tuple[str, str], known: bool
) -> None:
    """With process noise nothing is told for sure, and the best explanation has one effect."""
    explanation = SimpleNamespace(hypotheses=(SimpleNamespace(site=there[0], driver=there[1]),))
    told = Told("abstain", explanation, (), (), (explanation,), "")  # type: ignore[arg-type]
    assert telling._knows(told, state(word, LAW).judged) == known


def test_only_a_fault_at_the_place_of_an_unnamed_curve_may_leave_a_little_more() -> None:
    more, less = (OutputChange("y", "K", 9.0, left, 1.0, (0.5, 0.9)) for left in (1.05, 1.0))
    here, elsewhere = (("gains", "own_value"),), (("loss", "own_value"),)
    unnamed = state("unnamed", LAW)
    assert rivals.smaller((more,), (less,), rivals.allowed_ratio(unnamed, here))
    assert not rivals.smaller((more,), (less,), rivals.allowed_ratio(unnamed, elsewhere))
    assert not rivals.smaller((more,), (less,), rivals.allowed_ratio(state("named", LAW), here))


def test_one_effect_may_leave_a_little_more_than_a_larger_set_that_is_not_told() -> None:
    one, two = (("gains", "sun"),), (("gains", "sun"), ("loss", "wind"))

    wind = Effect("loss", "wind", "curve", {"value_1": 0.0, "value_2": 1.0}, {"knots": (0.0, 1.0)})

    def given(word: str, *effects: Effect) -> Any:
        found = effects or (LAW, wind)
        best = SimpleNamespace(effects=found, names=tuple((e.site, e.driver) for e in found))
        return SimpleNamespace(judged=SimpleNamespace(word=word, best=best), contradiction="")

    assert rivals.allowed_ratio(given("abstain"), one) > 1.0
    assert rivals.allowed_ratio(given("abstain"), two) > 1.0, "what both find is the same but for the search"
    assert rivals.allowed_ratio(given("abstain"), (("gains", "sun"), ("loss", "rain"))) == 1.0
    assert rivals.allowed_ratio(given("named"), one) == 1.0
    assert rivals.allowed_ratio(given("named", LAW, CURVE), (("loss", "wind"),)) == 1.0


@pytest.mark.parametrize(
    ("word", "members", "agrees"),
    [
        ("class", (("loss", "time"), ("heater", "own_value")), True),
        ("class", (("loss", "time"), ("other_heat", "power")), False),
        ("abstain", (), True),
    ],
)
def test_a_class_without_what_the_innovations_form_names_is_not_told(word: str, members: Any, agrees: bool) -> None:
    limit = SimpleNamespace(site="heater", label="heater range")
    told: Any = SimpleNamespace(effects=(limit,))
    judged: Any = SimpleNamespace(word=word, best=SimpleNamespace(names=members[:1]), members=members)
    assert telling.names_one_of(judged, told) == agrees


@pytest.mark.parametrize(("low", "word"), [(0.2, "none"), (-0.1, "abstain")])
def test_a_drift_explains_the_record_only_where_held_out_rows_get_better(low: float, word: str) -> None:
    error = (OutputChange("level", "m", 0.05, 0.04, 0.01, (low, 0.5)),)
    best: Any = SimpleNamespace(effects=(CURVE,), names=(("gains", "time"),))
    judged = Judgement("none", best, (), (), 0.0)
    nothing: dict[str, Any] = {f.name: None for f in fields(State)}
    given = State(**nothing | {"judgement": judged, "error": error})
    told: Any = SimpleNamespace(word="abstain", why="no rows confirm it", sites=frozenset())
    assert telling.kept(given, told).judged.word == word


@pytest.mark.parametrize(
    ("names", "why", "word"),
    [
        ((("pump", "speed"), ("inflow", "inflow")), f"as if it rained: {NO_SITE}", "abstain"),
        ((("pump", "speed"), ("inflow", "inflow")), "no rows confirm it", "class"),
        ((("pump", "speed"),), f"as if it rained: {NO_SITE}", "class"),
    ],
)
def test_several_effects_do_not_stand_in_for_what_has_no_site(names: Any, why: str, word: str) -> None:
    """Rain was told as four effects, two of them certain. One effect alone is compared with each place later."""
    best: Any = SimpleNamespace(effects=(LAW,) * len(names), names=names)
    nothing: dict[str, Any] = {f.name: None for f in fields(State)}
    told: Any = SimpleNamespace(word="abstain", why=why, sites=frozenset())
    given = State(**nothing | {"judgement": Judgement("class", best, names, (), 0.0)})
    assert telling.kept(given, told).judged.word == word


@pytest.mark.parametrize(("effect", "word"), [(CURVE, "abstain"), (LAW, "class")])
def test_a_class_of_free_curves_in_time_needs_the_innovations_form(effect: Effect, word: str) -> None:
    best: Any = SimpleNamespace(effects=(effect,), names=((effect.site, effect.driver),))
    judged = Judgement("class", best, (("gains", effect.driver), ("loss", effect.driver)), (), 0.0)
    nothing: dict[str, Any] = {f.name: None for f in fields(State)}
    told: Any = SimpleNamespace(word="abstain", why="no rows confirm it", sites=frozenset())
    assert telling.kept(State(**nothing | {"judgement": judged}), told).judged.word == word


@pytest.mark.parametrize(
    ("drifts", "low", "site", "another"),
    [
        (False, 0.8, "valve", True),  # the drift explains it, and a valve is told
        (False, 0.8, "gains", False),  # what is told is where the drift is
        (False, -0.1, "valve", False),  # held-out rows do not confirm the drift
        (True, 0.8, "valve", False),  # the model says that it drifts: nothing was asked
    ],
)
def test_a_drift_that_helps_is_not_replaced_by_something_elsewhere(
    drifts: bool, low: float, site: str, another: bool
) -> None:
    best = SimpleNamespace(effects=(CURVE,), names=(("gains", "time"),))
    fit = SimpleNamespace(model=SimpleNamespace(parameters=(SimpleNamespace(name="gain", drifts=drifts),)))
    given: Any = SimpleNamespace(
        judged=SimpleNamespace(word="none", best=best), refitted=(fit, fit),
        known_problem=SimpleNamespace(adapted=("gain",)), error=(OutputChange("y", "K", 4.0, 1.0, 1.0, (low, 0.9)),),
    )  # fmt: skip
    told: Any = SimpleNamespace(effects=(SimpleNamespace(site=site, label=site),))
    assert telling._another_drift(given, told) == another


@pytest.mark.parametrize(
    ("gains", "as_well"),
    [
        ({"doser": 287.0, "probe": 290.0}, True),
        ({"doser": 290.0, "probe": 280.0}, True),
        ({"doser": 99.0, "probe": 75.0}, False),
        ({"probe": 290.0}, False),
        ({"doser": 290.0}, False),
        ({"doser": -5.0, "probe": -5.0}, False),
    ],
)
@pytest.mark.parametrize("driver", ["lag", "delay"])
def test_a_free_run_tells_one_lag_from_another_only_by_enough(
    gains: dict[str, float], as_well: bool, driver: str
) -> None:
    other = {"lag": "delay", "delay": "lag"}[driver]  # a lag says nothing about a dead time, nor the other way round
    given: Any = SimpleNamespace(
        late={(site, driver): gain for site, gain in gains.items()} | {("probe", other): 1000.0}
    )
    told: Any = SimpleNamespace(certain=(SimpleNamespace(kind="lag", driver=driver, site="doser"),))
    assert rivals.late_as_well(given, told, "probe") == as_well


@pytest.mark.parametrize(
    ("word", "fall", "asked"), [("none", -900.0, True), ("none", -20.0, False), ("named", -900.0, False)]
)
def test_much_that_is_found_and_not_confirmed_is_not_nothing(word: str, fall: float, asked: bool) -> None:
    """A curve explains the rows that chose it and fails on others: something is there, and not the curve."""
    result = SimpleNamespace(alternatives=(SimpleNamespace(delta_bic=fall), SimpleNamespace(delta_bic=3.0)))
    given: Any = SimpleNamespace(judged=SimpleNamespace(word=word, best=None), searched=(None, result))
    assert rivals.unconfirmed(given) == asked


@pytest.mark.parametrize(
    ("word", "certain", "kept"), [("named", ("pump",), True), ("class", (), True), ("class", ("pump",), False)]
)
def test_what_has_no_site_stays_beside_a_name_that_alternatives_leave(
    word: Any, certain: tuple[str, ...], kept: bool
) -> None:
    """Else what a place explains as well would be a name again, once it has been compared with the free run's."""
    place = WithoutSite("balance of level", "time", "something adds to the balance of level")
    best: Any = SimpleNamespace(hypotheses=())
    before = Told("named", best, (), (), (best,), "", place)
    both = Told(word, best, certain, (), (best,), "")  # type: ignore[arg-type]
    assert telling.with_what_stood_beside(both, before).beside == (place if kept else None)
    assert telling.with_what_stood_beside(both, replace(before, beside=None)) is both


@pytest.mark.parametrize(("errs", "fall", "asked"), [(True, -60.0, True), (False, -60.0, False), (True, -40.0, False)])
def test_less_is_asked_about_where_the_model_errs(
    monkeypatch: pytest.MonkeyPatch, errs: bool, fall: float, asked: bool
) -> None:
    """A late thermometer left an error twice the noise, and was `none`: no alternative stood on fresh rows."""
    monkeypatch.setattr(rivals, "leaves_too_much", lambda state, far: errs)
    result = SimpleNamespace(alternatives=(SimpleNamespace(delta_bic=fall),))
    given: Any = SimpleNamespace(judged=SimpleNamespace(word="none", best=None), searched=(None, result))
    assert rivals.unconfirmed(given) == asked


@pytest.mark.parametrize(
    ("site", "driver", "word"),
    [("loss", "air", "named"), ("thermometer", "power", "unnamed"), ("thermometer", "time", "named")],
)
def test_a_dependence_that_its_site_has_no_reason_for_has_no_name_here_either(
    site: str, driver: str, word: str
) -> None:
    """A voltmeter by the charge of a cell was named, and the free run would have told a curve without a name.

    A feed by the concentration in the reactor was named as well, where no alternative of the free run had that pair.
    """
    state: Any = SimpleNamespace(model=model())
    told: Any = SimpleNamespace(word="named", open=(), effects=(), beside=None)
    best: Any = SimpleNamespace(names=((site, driver),))
    assert telling._judgement(state, told, best).word == word
