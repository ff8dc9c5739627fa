"""Verification on held-out rows, and the word that ranked alternatives amount to: made by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from adaptive_flot.discovery.assessment.likelihood import loglik_difference_sds
from adaptive_flot.discovery.assessment.verification import changes, verify, whiteness
from adaptive_flot.discovery.fitting.fit import row_losses
from adaptive_flot.discovery.hypotheses.families import hypotheses
from adaptive_flot.discovery.results import Alternative, Discovery, SearchResult, Verification
from adaptive_flot.discovery.test_design.experiment import leading
from adaptive_flot.discovery.verdict.idle_effects import without_idle_effects
from adaptive_flot.discovery.verdict.judge import (
    _one_way_each,
    but_for_what_has_no_reason,
    first_that_stands,
    held_up,
    judge,
)
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.discovery.verdict.words.wording import drift_words
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.quantities import KnownEffect
from tests.discovery.heated import heated_tank

BY_FAN, BY_HEATER, BY_TIME = ("heat_loss", "fan_speed"), ("heating", "fan_speed"), ("heat_loss", "time")
CONFIRMED = Verification(0.5, (0.4, 0.6), (), True)


def _search(draught: Discovery, *found: tuple[tuple[str, str], bool, float], left: float = 0.0,
            verification: Verification | None = CONFIRMED) -> SearchResult:  # fmt: skip
    """Alternatives by name, whether known, and how much worse than the first."""
    assert draught.search is not None
    own = draught.search.alternatives[0]
    alternatives = tuple(
        Alternative((name,), (known,), replace(own.fit, bic=own.fit.bic + worse), 0.0, -100.0 + worse)
        for name, known, worse in found
    )
    return replace(draught.search, alternatives=alternatives, verification=verification, left=left, left_threshold=10.0)


@pytest.mark.parametrize(
    ("lists", "rival", "site", "word"),
    [
        ("heating", 2.0, "thermometer", "abstain"),  # neither has a reason
        ("heat_loss", 2.0, "thermometer", "named"),  # the table has one
        ("", 2.0, "thermometer", "named"),  # there is no table
        ("heating", 50.0, "thermometer", "named"),  # the other is surely worse
        ("heating", 2.0, "heat_loss", "named"),  # the place is sure
    ],
)
def test_what_the_table_does_not_list_is_not_named_beside_something_nameless_as_near(
    draught: Discovery, lists: str, rival: float, site: str, word: str
) -> None:
    found = _search(draught, (BY_FAN, True, 0.0), ((site, "temperature"), False, rival))
    known = (KnownEffect(lists, "fan_speed", "a draught"),) if lists else ()
    table = tuple(
        replace(a, fit=replace(a.fit, model=replace(a.fit.model, known_effects=known))) for a in found.alternatives
    )
    found = replace(found, alternatives=table)
    assert judge(found).word == "named"
    assert but_for_what_has_no_reason(found, judge(found)).word == word


@pytest.mark.parametrize(
    ("found", "left", "word"),
    [
        ([], 0.0, "none"),
        ([(BY_FAN, True, 0.0)], 0.0, "named"),
        ([(BY_FAN, True, 0.0), (BY_HEATER, True, 11.0)], 0.0, "named"),
        ([(BY_FAN, True, 0.0), (BY_HEATER, True, 9.0)], 0.0, "class"),
        ([(BY_FAN, True, 0.0), (BY_HEATER, True, 40.0)], 60.0, "class"),  # the best leaves 50 above chance itself
        ([(BY_HEATER, False, 0.0), (BY_FAN, True, 5.0)], 0.0, "named"),  # of equals, the one that has a name
        ([(BY_HEATER, False, 0.0), (BY_FAN, True, 50.0)], 0.0, "unnamed"),
        ([(BY_HEATER, False, 0.0), (("thermometer", "power"), False, 2.0)], 0.0, "abstain"),
        ([(BY_FAN, True, 0.0), (BY_HEATER, True, 95.0)], 150.0, "abstain"),  # no better than no effect at all
        # a dependence that holds the constant as a special case and gains nothing is no other cause
        ([(("heat_loss", "constant"), True, 0.0), (BY_FAN, True, 8.6)], 0.0, "named"),
        ([(BY_FAN, True, 0.0), (("heat_loss", "constant"), True, 2.0)], 0.0, "named"),
        ([(("heat_loss", "constant"), True, 0.0), (BY_FAN, True, 8.6), (BY_HEATER, True, 9.0)], 0.0, "class"),
        ([((s, "fan_speed"), True, 1.0 * k) for k, s in enumerate("abcd")], 0.0, "abstain"),  # too many to be a class
        # a lag and a dead time of one part are one way to be late, a limit and a bent dependence one way to be short
        ([((s, d), True, 1.0 * k) for k, (s, d) in enumerate(product("ab", ("lag", "delay")))], 0.0, "class"),
        ([((s, d), True, 1.0 * k) for k, (s, d) in enumerate(product("abcd", ("lag", "delay")))], 0.0, "abstain"),
        ([((s, d), True, 1.0 * k) for k, (s, d) in enumerate(product("ab", ("saturation", "u")))], 0.0, "class"),
        ([((s, d), True, 1.0 * k) for k, (s, d) in enumerate(product("ab", ("time", "u")))], 0.0, "abstain"),
    ],
)
def test_the_word(draught: Discovery, found: list[tuple[tuple[str, str], bool, float]], left: float, word: str) -> None:
    judged = judge(_search(draught, *found, left=left))
    assert judged.word == word
    if word in ("named", "class"):
        assert judged.best is not None and all(judged.best.known)
    assert (len(judged.members) > 1) == (word == "class")
    assert all(rival is not judged.best for rival in judged.rivals)


RAMP = Effect("heat_loss", "time", "ramp", {"amplitude": 0.2, "onset": 0.0, "duration": 9000.0})
COURSE = Effect(
    "heat_loss", "time", "curve", {f"value_{k}": 0.1 * k for k in (1, 2, 3)}, {"knots": (0.0, 9000.0, 18000.0)}
)


@pytest.mark.parametrize(
    ("nuisance", "drifts", "drift", "word"),
    [
        (None, True, RAMP, "none"),
        (("heating", "time"), True, RAMP, "abstain"),
        # a catalyst that had lost 38 % of its activity was `none`, with errors 13 times as small
        (None, False, RAMP, "class"),
        (None, False, COURSE, "none"),  # a curve follows whatever wanders
    ],
)
def test_a_drift_is_all_there_is_where_the_model_says_so_and_nothing_was_added_beside_it(
    draught: Discovery, nuisance: tuple[str, str] | None, drifts: bool, drift: Effect, word: str
) -> None:
    found = _search(draught, (BY_TIME, True, 0.0), (BY_FAN, True, 5.0))
    own, tank = found.alternatives[0], found.base.model
    says = replace(tank, parameters=tuple(replace(p, drifts=drifts) for p in tank.parameters))
    model = heated_tank().with_effects([drift])
    alternatives = (replace(own, fit=replace(own.fit, model=model)), found.alternatives[1])
    found = replace(found, alternatives=alternatives, common_nuisance=nuisance, adapted_sites=("heat_loss",))
    judged = judge(replace(found, base=replace(found.base, model=says)))
    assert judged.word == word and judged.best is alternatives[0]


def test_a_rival_that_could_as_well_have_been_better_is_not_told_apart(draught: Discovery) -> None:
    """Worse by 50, but a difference of 30 would be nothing unusual."""
    found = _search(draught, (BY_FAN, True, 0.0), (BY_HEATER, True, 50.0))
    best, rival = found.alternatives
    assert judge(found).word == "named"
    unsure = judge(replace(found, alternatives=(best, replace(rival, loglik_difference_sd=30.0))))
    assert unsure.word == "class" and unsure.near(rival) is False and unsure.near(unsure.rivals[0])


def test_evidence_of_correlated_innovations_counts_once(draught: Discovery) -> None:
    found = _search(draught, (BY_FAN, True, 0.0), (BY_HEATER, True, 50.0))
    assert judge(replace(found, rows_per_effective_sample=4.0)).word == "named"
    assert judge(replace(found, rows_per_effective_sample=6.0)).word == "class"


def test_the_loglik_difference_sd_is_the_spread_of_the_difference_over_blocks(draught: Discovery) -> None:
    """Against itself none; against the model without the effect far less than what that one is worse by."""
    problem, before, after = draught.problem, draught.before, draught.after
    assert problem is not None and before is not None and after is not None
    same, other = loglik_difference_sds(problem, after, [after, before])
    assert same == 0.0
    rows = problem.rows("estimate")
    difference = float(np.sum(row_losses(problem, before, rows) - row_losses(problem, after, rows)))
    assert 0 < other < difference / 4


def test_nothing_is_named_that_does_not_stand_on_fresh_rows(draught: Discovery) -> None:
    name = (BY_FAN, True, 0.0)
    by_chance = Verification(0.0, (-0.1, 0.1), (), False)
    assert judge(_search(draught, name, verification=by_chance)).word == "none"
    one_worse = Verification(0.3, (0.2, 0.4), ("level",), False)
    assert judge(_search(draught, name, verification=one_worse)).word == "abstain"


def test_verify_tells_better_from_the_same_and_the_worse(draught: Discovery) -> None:
    problem, before, after = draught.problem, draught.before, draught.after
    assert problem is not None and before is not None and after is not None
    assert verify(problem, before, after).confirmed
    same = verify(problem, before, before)
    assert same.reduction == 0 and not same.confirmed
    back = verify(problem, after, before)
    assert not back.confirmed and back.worse == ("temperature",)


def test_the_error_is_that_of_the_split_and_the_interval_holds_it(draught: Discovery) -> None:
    problem, before, after = draught.problem, draught.before, draught.after
    assert problem is not None and before is not None and after is not None
    (change,) = changes(problem, before, after, "report")
    rows = problem.rows("report")
    expected = [float(np.sqrt(np.mean(f.residual(problem)[rows] ** 2))) for f in (before, after)]
    assert [change.before, change.after] == pytest.approx(expected)
    low, high = change.reduction95
    assert 0.5 < low < 1 - change.after / change.before < high < 1
    assert change.noise == pytest.approx(0.05, rel=0.15) and change.after < 1.5 * change.noise


def test_whiteness_tells_what_is_left(draught: Discovery) -> None:
    problem, before, after = draught.problem, draught.before, draught.after
    assert problem is not None and before is not None and after is not None
    assert whiteness(problem, before, raw=True)["temperature"] < 1e-6
    assert whiteness(problem, after, raw=True)["temperature"] > 0.01


def test_only_those_close_to_the_best_are_worth_a_test(draught: Discovery) -> None:
    found = _search(draught, (BY_FAN, True, 0.0), (BY_HEATER, False, 25.0), (BY_TIME, True, 80.0), (BY_FAN, True, 1.0))
    best, *others = found.alternatives
    assert [a.names for a in leading(best, others, 10.0)] == [(BY_FAN,), (BY_HEATER,)]
    assert len(leading(best, others, 100.0)) == 3


def test_the_machine_readable_verdict_is_that_of_the_design(draught: Discovery) -> None:
    told = json.loads(json.dumps(draught.verdict.as_dict()))
    assert told["verdict"] == "named" and told["class"] == []
    (effect,) = told["effects"]
    assert (effect["site"], effect["driver"], effect["form"]) == (*BY_FAN, "power")
    low, high = effect["interval95"]["exponent"]
    assert low < 0.6 < high and low < effect["parameters"]["exponent"] < high
    assert all(a["delta_bic"] > 0 for a in effect["alternatives"])
    assert all(a["sd"] >= 0 for a in effect["alternatives"])
    assert [d["output"] for d in told["detection"]] == ["temperature"] == told["location"]["outputs"]
    report = np.array(told["report_times_s"])
    assert np.all(report[:, 0] < report[:, 1]) and np.all(report[1:, 0] > report[:-1, 1])
    error = told["error"]["temperature"]
    assert set(error) == {"unit", "before", "after", "noise", "reduction95", "block"} and error["unit"] == "K"
    assert told["tests"]["ljung_box_before"] < 1e-6 < told["tests"]["ljung_box_after"]
    assert set(told["parameters"]) == {"efficiency", "loss"} == set(told["absorbed"])


def test_the_curve_shows_the_shape_where_a_constant_is_an_adapted_parameter(draught: Discovery) -> None:
    """Any constant factor on the loss is the parameter `loss`: the band is that of (fan / middle)^0.6 and holds it."""
    assert draught.problem is not None and draught.after is not None
    (curve,) = effect_curves(draught.problem, draught.after, 1)
    assert curve.anchor is not None
    first = draught.problem.first_row
    np.testing.assert_array_equal(curve.seen, draught.problem.record.inputs[first:, 1])  # not what was left out
    truth = (curve.driver / curve.anchor) ** 0.6
    assert np.all(curve.low <= curve.high) and np.max(curve.high - curve.low) < 0.1
    assert np.mean((curve.low - 1e-9 <= truth) & (truth <= curve.high + 1e-9)) > 0.9


def test_a_part_that_leaks_has_no_curve_and_no_page_fails_of_it(draught: Discovery) -> None:
    """It depends on the value at its own site, which is no series of the record."""
    assert draught.problem is not None and draught.after is not None
    leak = Effect("heating", "own_value", "leak", {"level": 0.1}, {"width": 0.01})
    leaking = replace(draught.after, model=draught.after.model.with_effects([leak]))
    assert effect_curves(draught.problem, leaking, 1) == ()
    assert len(effect_curves(draught.problem, leaking, 2)) == 1


def test_whatever_may_be_named_has_a_curve_or_none(draught: Discovery) -> None:
    """Each family of the innovations form, at every site: a page that asks for its curve never fails."""
    assert draught.problem is not None and draught.after is not None
    fit, record = draught.after, draught.problem.record
    levels = np.linspace(1.0, 2.0, 50)
    seen = {site.name: levels for site in fit.model.sites}
    drivers = {q.name: levels for q in (*fit.model.inputs, *fit.model.states)}
    found = hypotheses(fit.model, seen, drivers, record.dt, float(record.time[-1] - record.time[0]))
    assert len({h.kind for h in found}) > 5
    for h in found:
        if h.effect.label in {e.label for e in fit.model.effects}:
            continue
        model = fit.model.with_effects([h.effect])
        extra = len(model.states) - len(fit.model.states)
        named = replace(fit, model=model, initial_state=np.append(fit.initial_state, np.ones(extra)))
        assert len(effect_curves(draught.problem, named, 1)) <= 1, h.label


def test_a_hidden_store_has_no_curve_and_no_page_fails_of_it(draught: Discovery) -> None:
    """What a store does depends on what was before, so that no curve in its driver shows it."""
    assert draught.problem is not None and draught.after is not None
    driver = draught.after.model.states[0].name
    store = Effect("heat_loss", driver, "store", {"exchange": 0.1, "time_constant": 600.0})
    model = draught.after.model.with_effects([store])
    assert f"{store.label}.store" in [q.name for q in model.states]
    with_store = replace(
        draught.after, model=model, initial_state=np.append(draught.after.initial_state, draught.after.initial_state[0])
    )
    curves = effect_curves(draught.problem, with_store, 2)
    assert [c.effect.label for c in curves] == [e.label for e in draught.after.model.fitted_effects()[-1:]]
    assert effect_curves(draught.problem, with_store, 1) == ()


@pytest.mark.parametrize(("profile", "said"), [([0.0, 0.1, 0.2], "+22 %"), ([0.2, 0.1, 0.0], "-18 %")])
def test_a_drift_is_told_with_its_direction(draught: Discovery, profile: list[float], said: str) -> None:
    """A fall is no rise: the sign is that of the larger extreme coming last."""
    assert draught.judgement is not None and draught.judgement.best is not None and draught.after is not None
    knots = {"knots": (0.0, 1.0, 2.0)}
    effect = Effect("heat_loss", "time", "curve", {f"value_{k + 1}": v for k, v in enumerate(profile)}, knots)
    after = replace(draught.after, model=heated_tank().with_effects([effect]))
    assert said in drift_words(draught.judgement, after)[0]


def test_a_name_is_confirmed_for_what_it_names(draught: Discovery) -> None:
    """The best alternative, which was confirmed, has no name; the one beside it has, and must stand by itself."""
    assert draught.problem is not None and draught.search is not None
    found = _search(draught, (BY_HEATER, False, 0.0), (BY_FAN, True, 5.0))
    stands, judged = held_up(draught.problem, found, judge(found))
    assert judged.word == "named" and stands.verification is not None and stands.verification != found.verification
    nothing = replace(found.alternatives[1], fit=draught.search.base)
    found = replace(found, alternatives=(found.alternatives[0], replace(nothing, adjusted_bic=None)))
    found = replace(
        found, alternatives=tuple(replace(a, adjusted_bic=5.0 * k) for k, a in enumerate(found.alternatives))
    )
    assert judge(found).word == "named"
    assert held_up(draught.problem, found, judge(found))[1].word == "abstain"


@pytest.mark.parametrize(("alone", "told"), [(5.0, (BY_FAN,)), (50.0, (BY_FAN, BY_TIME))])
def test_an_effect_that_adds_nothing_to_another_is_not_told(
    draught: Discovery, alone: float, told: tuple[tuple[str, str], ...]
) -> None:
    """The first effect alone is worse than both by a criterion of `alone`: by less than 10, the second one is idle."""
    assert draught.problem is not None
    found = _search(draught, (BY_FAN, True, 0.0))
    (both,) = found.alternatives
    first = replace(both, fit=replace(both.fit, bic=both.fit.bic + alone))
    both = replace(both, names=(BY_FAN, BY_TIME), known=(True, True))
    round_1 = replace(found.rounds[0], alternatives=(first,))
    found = replace(found, rounds=(round_1,), alternatives=(both,))
    judged = replace(judge(found), word="named", best=both)
    result, judged = without_idle_effects(draught.problem, found, judged)
    assert judged.best is not None and judged.best.names == told == result.alternatives[0].names
    assert judged.word == "named"


def test_what_fresh_rows_contradict_gives_way_to_a_name_that_is_as_good_and_stands(draught: Discovery) -> None:
    """The best one makes an output worse. One as good takes its place; one that is surely worse does not."""
    assert draught.problem is not None
    contradicted = Verification(0.8, (0.7, 0.9), ("level",), False)
    for worse, front in ((5.0, BY_FAN), (50.0, BY_HEATER)):
        found = _search(draught, (BY_HEATER, False, 0.0), (BY_FAN, True, worse), verification=contradicted)
        stands = first_that_stands(draught.problem, found)
        assert stands.alternatives[0].names == (front,) and len(stands.alternatives) == 2
        assert judge(stands).word == ("named" if front == BY_FAN else "abstain")


def test_a_class_counts_each_part_once_for_each_way_and_keeps_the_likelier_one() -> None:
    members = (
        ("valve", "delay"),
        ("gauge", "lag"),
        ("valve", "lag"),
        ("valve", "u"),
        ("gauge", "saturation"),
        ("gauge", "u"),
    )
    assert _one_way_each(members) == (("valve", "delay"), ("gauge", "lag"), ("valve", "u"), ("gauge", "saturation"))
