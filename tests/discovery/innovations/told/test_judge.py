"""What is told when an effect does not hold on rows that did not fit it: the search behind is a stand-in."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations import judge as judging
from adaptive_flot.discovery.innovations.search.explanation import worth
from adaptive_flot.discovery.innovations.verdicts import rivals
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.effects import Effect

ROWS = 200


@dataclass(frozen=True)
class Given:
    """An explanation with a criterion and fresh rows that are given, not fitted."""

    hypotheses: tuple[Hypothesis, ...]
    criterion: float
    fresh: float
    numbers: int = 0
    slope: float = 0.0
    fit: Any = field(default_factory=lambda: Rows(np.zeros(ROWS)))


@dataclass(frozen=True)
class Rows:
    rows: np.ndarray


class Stand:
    """A search that knows three explanations; without an effect, an explanation is the rest of it."""

    record = Dataset(
        "", np.arange(0, 10.0 * ROWS, 10.0), 10.0, np.sign(np.arange(ROWS) // 20 % 2.0)[:, None], np.zeros((ROWS, 1))
    )
    """An input that is switched every 200 s."""
    processes = 1

    def __init__(self, *known: Given, since_reference: bool = False) -> None:
        self.since_reference = since_reference
        self.known = {tuple(h.site for h in e.hypotheses): e for e in known}
        self.known |= {tuple(h.effect.label for h in e.hypotheses): e for e in known}

    def model_of(self, explanation: Given) -> Any:
        """A model whose only parameter is the slope of a span."""
        return SimpleNamespace(parameters=[SimpleNamespace(name=SPAN.parameters[0], value=explanation.slope)])

    def without(self, explanation: Given, left_out: Hypothesis) -> Given:
        rest = [h for h in explanation.hypotheses if h is not left_out]
        return self.known.get(tuple(h.effect.label for h in rest)) or self.known[tuple(h.site for h in rest)]

    def late_elsewhere(self, explanation: Given, late: Hypothesis) -> list[Given]:
        """A lag explains half as much at another place."""
        return [Given((lag("elsewhere"),), explanation.criterion / 2, 0.1)]


def lag(site: str) -> Hypothesis:
    """A lag at a site."""
    return Hypothesis(
        site, "lag", "lag", Effect(site, "lag", "lag", settings={"scale": 1.0}), ("time_constant",), ({},)
    )


def event(site: str, *times: tuple[float, float]) -> Hypothesis:
    """Something that is switched on for a while, at times [s]."""
    told = {f"{name}_{k}": t for k, pair in enumerate(times, 1) for name, t in zip(("on", "for"), pair, strict=True)}
    effect = Effect(site, "time", "switch", told, {"count": float(len(times)), "width": 0.5}, mode="offset")
    return Hypothesis(site, "time", "switch", effect, ("amplitude",), ({},))


SPAN = Hypothesis("sensor", "own_value", "span", Effect("sensor", "own_value", "span", settings={"middle": 1.0}),
                  ("slope",), ({},), {"slope": (-0.3, 0.3)})  # fmt: skip


@pytest.fixture(autouse=True)
def _given_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fresh rows are those given; better explanations are better by the same in every row, and told apart."""
    monkeypatch.setattr(judging, "_fresh_rows", lambda search, e: np.full(ROWS, e.fresh))
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: best is not other)


def told(*found: Given, since_reference: bool = False) -> judging.Told:
    base = Given((), 0.0, 0.0)
    search: Any = Stand(base, *found, since_reference=since_reference)
    ranked: Any = sorted([base, *found], key=lambda e: -worth(e))
    return judging.judge(search, ranked[-1], ranked)


def asked_again(said: judging.Told, *found: Given) -> judging.Told:
    """What is told by the rule on two effects; `found` is what the search knows."""
    base: Any = Given((), 0.0, 0.0)
    search: Any = Stand(base, *found)
    return rivals.not_two(search, base, said)


def test_an_effect_that_predicts_no_fresh_rows_is_not_named_and_not_called_nothing() -> None:
    """A large gain on the rows that fitted is not "constants and process noise explain it"."""
    said = told(Given((lag("sensor"),), 500.0, -1.0))
    assert said.word == "abstain"
    assert "sensor lag predicts no rows" in said.why


def test_a_pair_of_which_neither_holds_alone_is_told_as_nothing_named() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, -1.0), Given((one,), 400.0, -0.5), Given((two,), 3.0, -0.2))
    assert said.word == "abstain"
    assert "sensor" in said.why or "valve" in said.why


def test_an_effect_that_holds_is_named_beside_one_that_does_not() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, 0.5), Given((one,), 400.0, 0.6), Given((two,), 3.0, 0.01))
    assert said.word == "named"
    assert [h.site for h in said.certain] == ["sensor"]


def test_a_small_effect_beside_a_large_one_is_not_told() -> None:
    one, two = lag("sensor"), lag("valve")
    said = told(Given((one, two), 500.0, 0.9), Given((one,), 480.0, 0.5), Given((two,), 30.0, 0.1))
    assert said.word == "named"
    assert [h.site for h in said.certain] == ["sensor"]


def test_a_lag_and_a_dead_time_of_one_part_are_two_effects() -> None:
    """Measured: a throttle motor. Both are a "throttle_motor lag", and the one for the other was a crash."""
    slow = lag("motor")
    late = replace(slow, driver="delay", effect=replace(slow.effect, driver="delay", form="delay"))
    pair, best = Given((slow, late), 500.0, 0.9), Given((slow,), 490.0, 0.8)
    said = told(pair, Given((late,), 450.0, 0.5), best)
    assert said.word == "named" and said.certain == (slow,)
    assert said.best.criterion == best.criterion


def test_nothing_is_missing_where_no_explanation_gains() -> None:
    assert told(Given((lag("sensor"),), 5.0, 0.1)).word == "none"


@pytest.mark.parametrize(
    ("hull", "indicator", "fresh", "word"),
    [(480.0, 300.0, 0.5, "named"), (None, 300.0, 0.5, "abstain"), (480.0, 300.0, -0.5, "abstain")],
)
def test_an_event_is_told_without_a_partner_that_would_have_to_be_too_large(
    hull: float | None, indicator: float, fresh: float, word: str
) -> None:
    """Measured: a rudder lost force, and a span of the gyro at its limit took up what else the model lacks.

    The event must be found alone, and must predict fresh rows.
    """
    force = event("rudder", (800.0, 1200.0))
    pair, other = Given((force, SPAN), 600.0, 0.7, slope=0.3), Given((lag("indicator"),), indicator, 0.3)
    alone = [Given((force,), hull, fresh)] if hull else []
    said = told(pair, *alone, other, Given((SPAN,), 100.0, 0.1, slope=0.3))
    assert said.word == word, said.why
    assert [h.site for h in said.certain] == (["rudder"] if word == "named" else [])


@pytest.mark.parametrize(("slope", "word"), [(-0.1, "named"), (-0.2999, "abstain"), (0.3, "abstain")])
def test_a_fault_at_the_end_of_its_range_is_no_explanation(slope: float, word: str) -> None:
    """Though it predicts fresh rows and fits best: the record asks for more than such a fault can give."""
    said = told(Given((SPAN,), 500.0, 0.5, slope=slope), Given((lag("valve"),), 300.0, 0.4))
    assert said.word == word
    assert word == "named" or "larger than such a fault can be" in said.why


def test_a_fault_at_the_end_of_its_range_that_gains_nothing_is_nothing() -> None:
    assert told(Given((SPAN,), 1.0, 0.0, slope=0.3)).word == "none"


def test_a_fault_that_reaches_the_end_of_its_range_alone_is_not_told_without_what_was_beside_it() -> None:
    """Heat of a second reaction: a thermometer with a span 30 % larger, once the pump's offset was left out."""
    beside = lag("pump")
    pair, alone = Given((SPAN, beside), 500.0, 0.9, slope=0.2), Given((SPAN,), 480.0, 0.5, slope=0.3)
    said = told(pair, alone, Given((beside,), 30.0, 0.1))
    assert said.word == "abstain" and "larger than such a fault can be" in said.why


def test_pairs_that_share_no_effect_are_no_class_of_single_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each explanation has two effects: "one of these two sites" would be false of all of them."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    x, y = lag("sensor"), lag("valve")
    x_late, y_late = (replace(h, driver="time", effect=replace(h.effect, driver="time")) for h in (x, y))
    pairs = Given((x_late, y), 500.0, 0.5), Given((y_late, x), 499.0, 0.5)
    singles = [Given((h,), 100.0, 0.1) for h in (x, y)]
    search: Any = Stand(Given((), 0.0, 0.0), *pairs, *singles)
    ranked: Any = [*pairs, Given((), 0.0, 0.0)]
    assert judging.judge(search, ranked[-1], ranked).word == "abstain"


def test_one_part_that_is_limited_or_has_stopped_is_a_class_of_the_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured: a heater that gives 55 % at most, and was asked for more from some time on. Its place is certain."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    said = told(Given((lag("heater"),), 500.0, 0.5), Given((event("heater", (800.0, 1200.0)),), 499.0, 0.5))
    assert said.word == "class" and said.certain == ()
    assert [(h.site, h.kind) for _, h in said.open] == [("heater", "lag"), ("heater", "switch")]


@pytest.mark.parametrize(("alone", "word", "open_ones"), [(480.0, "named", []), (300.0, "class", ["valve", "duct"])])
def test_a_small_effect_that_is_one_of_two_is_not_told_either(
    alone: float, word: str, open_ones: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is certain by itself brings 480 or 300 of 500."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: len(other.hypotheses) < 2)
    late, one, two = lag("sensor"), lag("valve"), lag("duct")
    said = told(
        Given((late, one), 500.0, 0.9),
        Given((late, two), 499.0, 0.9),
        Given((late,), alone, 0.5),
        Given((one,), 30.0, 0.1),
        Given((two,), 30.0, 0.1),
    )
    assert said.word == word
    assert [h.site for h in said.certain] == ["sensor"]
    assert [h.site for _, h in said.open] == open_ones


@pytest.mark.parametrize(("alike", "word"), [("elsewhere", "class"), ("nowhere", "named")])
def test_a_lag_that_a_free_run_does_not_tell_from_another_is_a_class_with_that(alike: str, word: str) -> None:
    """The filter has the other one at half of the gain, by how it lets the process wander."""
    search: Any = Stand(Given((), 0.0, 0.0))
    named = told(Given((lag("sensor"),), 500.0, 1.0))
    assert named.word == "named"
    again = judging.late_where(search, named, lambda _, site: site == alike)
    assert again.word == word
    assert {h.site for h in again.effects} == ({"sensor", "elsewhere"} if word == "class" else {"sensor"})


AT_STEPS, BETWEEN = ((200.0, 200.0), (600.0, 210.0), (1000.0, 190.0)), ((250.0, 200.0), (650.0, 200.0), (1050.0, 200.0))


@pytest.mark.parametrize(("times", "sites"), [(AT_STEPS, ["valve"]), (BETWEEN, ["valve", "sensor"])])
def test_an_event_at_the_steps_of_an_input_is_none(times: tuple[tuple[float, float], ...], sites: list[str]) -> None:
    """It follows the input, so it takes up what is wrong with the model there; what is beside it is told."""
    valve, shift = lag("valve"), event("sensor", *times)
    said = told(Given((valve, shift), 500.0, 0.9), Given((valve,), 80.0, 0.5), Given((shift,), 200.0, 0.3))
    assert said.word == "named"
    assert [h.site for h in said.certain] == sites


def test_an_event_alone_may_come_with_an_input() -> None:
    """Guests come when those who are counted go."""
    assert told(Given((event("sensor", *AT_STEPS),), 500.0, 0.9)).word == "named"


def test_why_nothing_is_told_says_that_an_event_follows_an_input() -> None:
    valve, shift = lag("valve"), event("sensor", *AT_STEPS)
    said = told(Given((valve, shift), 500.0, 0.9), Given((valve,), 300.0, -0.5), Given((shift,), 200.0, -0.3))
    assert said.word == "abstain"
    assert "sensor switch: at steps of an input, so it is no event" in said.why and "valve lag predicts" in said.why


@pytest.mark.parametrize(("kind", "word"), [("offset", "abstain"), ("store", "named")])
def test_two_effects_by_name_are_rarer_than_a_third_thing_that_they_stand_in_for(kind: str, word: str) -> None:
    """But for a store, which most models leave out."""
    first = lag("sensor")
    other = replace(lag("valve"), kind=kind, driver="level")  # type: ignore[arg-type]
    said = told(Given((first, other), 500.0, 0.9), Given((first,), 300.0, 0.5), Given((other,), 250.0, 0.4))
    assert said.word == "named" and len(said.certain) == 2
    asked = asked_again(said)
    assert asked.word == word and "sensor" in asked.why + str(asked.certain)
    assert asked_again(told(Given((first,), 500.0, 1.0))).word == "named"


@pytest.mark.parametrize(
    ("long", "alone", "other", "sites"),
    [
        (1e7, 300.0, 200.0, ["gyro"]),
        (1e7, 240.0, 100.0, []),
        (200.0, 360.0, 140.0, ["gyro"]),
        (200.0, 340.0, 140.0, ["damping"]),
        (200.0, 360.0, 160.0, ["damping"]),
    ],
)
def test_an_event_that_has_most_of_the_gain_with_and_without_the_other_effect_stands_by_itself(
    long: float, alone: float, other: float, sites: list[str]
) -> None:
    """A gyro came to show more at a row, beside a law of the ship that is a little wrong: the gyro is told.

    Of what goes again more is asked: a bypass that was open for a time, beside a positioner with a little play.
    """
    gyro, law = event("gyro", (250.0, long)), replace(lag("damping"), kind="depends", driver="speed")
    found = Given((gyro, law), 500.0, 0.9), Given((gyro,), alone, 0.5), Given((law,), other, 0.4)
    said = told(*found)
    asked = asked_again(said, *found)
    assert asked.word == ("named" if sites else "abstain")
    assert [h.site for h in asked.certain] == sites


def test_two_stores_say_how_the_process_is_and_are_no_fault() -> None:
    """A gauge that slips was named as a store behind the inflow, and another one behind the outflow."""
    stores = [replace(lag(site), kind="store", driver="level") for site in ("inflow", "outflow")]
    said = told(Given(tuple(stores), 500.0, 0.9), *(Given((s,), 300.0, 0.5) for s in stores))
    assert said.word == "named" and asked_again(said).word == "abstain"


@pytest.mark.parametrize(("alone", "word"), [(False, "abstain"), (True, "class")])
def test_a_class_of_events_that_all_need_a_second_effect_is_not_told(alone: bool, word: str) -> None:
    """A motor's dry friction was seven pulses of its voltage or its load, with an offset or a dead zone beside them."""
    one, two, offset = event("amplifier", (25.0, 20.0)), event("load", (25.0, 20.0)), lag("sensor")
    first = (one,) if alone else (one, offset)
    best: Any = [Given(first, 500.0, 0.9), Given((two, offset), 498.0, 0.9)]
    said = judging.Told("class", best[0], (), ((best[0], one), (best[1], two)), tuple(best), "")
    asked = asked_again(said)
    assert asked.word == word and (alone or "one of amplifier switch, load switch" in asked.why)


@pytest.mark.parametrize(("alone", "word", "sites"), [(450.0, "named", ["load"]), (200.0, "abstain", [])])
def test_an_event_with_one_of_a_class_beside_it_is_told_where_it_stands_by_itself(
    alone: float, word: str, sites: list[str]
) -> None:
    """Two effects are needed here, too, whichever the second one is: a healthy wall had a late thermometer so."""
    load, one, two = event("load", (250.0, 1e7)), lag("sensor"), lag("motor")
    best: Any = [Given((load, one), 600.0, 0.9), Given((load, two), 598.0, 0.9)]
    said = judging.Told("class", best[0], (load,), ((best[0], one), (best[1], two)), tuple(best), "")
    asked = asked_again(said, *best, Given((load,), alone, 0.5), Given((one,), 100.0, 0.5))
    assert asked.word == word and [h.site for h in asked.effects] == sites
    assert word == "named" or "load switch and one of sensor lag, motor lag" in asked.why


def test_an_effect_more_beside_one_of_a_class_is_no_other_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gains by wind, or the loss by wind, or the loss by wind and something else: one of the first two."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    one, two, more = lag("gains"), lag("loss"), lag("heater")
    said = told(Given((one,), 500.0, 0.9), Given((two,), 498.0, 0.9), Given((two, more), 505.0, 0.9))
    assert said.word == "class" and not said.certain
    assert [h.site for _, h in said.open] == ["gains", "loss"]


@pytest.mark.parametrize(("again", "word"), [(0.0, "named"), (60.0, "named"), (90.0, "abstain")])
def test_an_event_at_a_site_that_changes_as_much_at_other_times_is_none(again: float, word: str) -> None:
    """The event gains 300; a fan's pressure that wanders gains 138 by its largest swing, and 64 by the next."""
    lid = event("lid", (250.0, 200.0))
    said = told(Given((lid,), 300.0, 0.9))
    search: Any = SimpleNamespace(switched_again=lambda explanation, h: again)
    asked = rivals.unless_it_wanders(search, Given((), 0.0, 0.0), said)  # type: ignore[arg-type]
    assert asked.word == word and (word == "named" or "it wanders" in asked.why)
    small = replace(said, best=Given((lid,), 40.0, 0.9))  # type: ignore[arg-type]
    assert rivals.unless_it_wanders(search, Given((), 0.0, 0.0), small).word == "abstain"  # type: ignore[arg-type]
    lasting = told(Given((lag("valve"),), 300.0, 0.9))
    assert rivals.unless_it_wanders(search, Given((), 0.0, 0.0), lasting) is lasting  # type: ignore[arg-type]


def shift(site: str) -> Hypothesis:
    """A constant error at a site."""
    return Hypothesis(site, "constant", "offset", Effect(site, "constant", "shift"), ("amplitude",), ({},))


def test_what_is_given_up_takes_nothing_else_at_its_site_with_it() -> None:
    """An amplifier that answers late, and beside that an offset there which predicts nothing."""
    late, off = lag("amplifier"), shift("amplifier")
    pair, alone = Given((late, off), 520.0, 0.5), Given((late,), 500.0, 0.6)
    base = Given((), 0.0, 0.0)
    search: Any = Stand(base, pair)
    search.without = lambda e, h: alone if h is off else Given((off,), 3.0, 0.0)
    ranked: Any = [pair, alone, base]
    said = judging.judge(search, ranked[-1], ranked)
    assert said.word == "named" and said.certain == (late,)


def test_a_lag_elsewhere_with_something_more_is_no_other_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lags commute: a late amplifier, or a late tachometer and a load, are a lag, and a lag with a load."""
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: not other.hypotheses)
    one, two, load = lag("amplifier"), lag("tachometer"), event("load", (100.0, 300.0))
    monkeypatch.setattr(judging, "at_steps_of_an_input", lambda search, e: ())
    said = told(Given((one,), 500.0, 0.9), Given((two, load), 505.0, 0.9), Given((two,), 490.0, 0.8))
    assert said.word == "class" and [h.site for _, h in said.open] == ["amplifier", "tachometer"]


@pytest.mark.parametrize(("without", "sites"), [(20.0, ["loss", "lid"]), (90.0, ["loss", "lid"]), (150.0, ["loss"])])
def test_an_event_beside_another_effect_explains_what_nothing_else_does(without: float, sites: list[str]) -> None:
    """A lid of which a store draws a tenth; and a wall's store, of which two long pulses draw the rest."""
    store, lid = replace(lag("loss"), kind="store", driver="air"), event("lid", (250.0, 200.0))
    said = told(Given((store, lid), 500.0, 0.9), Given((store,), without, 0.4), Given((lid,), 300.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


def test_an_event_that_explains_most_alone_is_not_given_up_for_what_another_effect_draws_of_it() -> None:
    """A condenser that fouls, of which a dependence on the flow draws a third and adds a tenth."""
    law, fouls = replace(lag("transfer"), kind="depends", driver="flow"), event("condenser", (250.0, 1e7))
    said = told(Given((law, fouls), 500.0, 0.9), Given((law,), 150.0, 0.3), Given((fouls,), 450.0, 0.8))
    assert said.word == "named" and [h.site for h in said.certain] == ["condenser"]


@pytest.mark.parametrize(("kind", "sites"), [("depends", ["law", "blower"]), ("gain", ["law"])])
def test_since_a_reference_a_law_of_the_plant_takes_no_event_that_explains_more(kind: str, sites: list[str]) -> None:
    """A blower that stays where it is for some hours, of which a law draws a fifth. A gain may well have changed."""
    law, stays = replace(lag("law"), kind=kind, driver="feed"), event("blower", (250.0, 200.0))  # type: ignore[arg-type]
    found = Given((law, stays), 500.0, 0.9), Given((law,), 105.0, 0.3), Given((stays,), 340.0, 0.8)
    assert [h.site for h in told(*found, since_reference=True).certain] == sites
    assert [h.site for h in told(*found).certain] == ["law"]


@pytest.mark.parametrize(
    ("alone", "apart", "said"),
    [(300.0, True, "leak switch with heater depends"), (300.0, False, "leak switch explains"), (90.0, False, "")],
)
def test_nothing_else_is_told_where_what_was_given_up_explains_more(
    alone: float, apart: bool, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A leak for a while, of which a dependence takes a part: the pump was named, for an event of less worth."""
    leak, law = event("leak", (250.0, 400.0)), replace(lag("heater"), driver="heat", kind="depends")
    both, other = Given((leak, law), 500.0, 0.9), Given((event("pump", (250.0, 1e7)),), 200.0, 0.8)
    monkeypatch.setattr(
        judging, "told_apart", lambda search, base, best, e: best is not e and not (e is other and not apart)
    )
    found = told(both, Given((law,), 150.0, 0.4), Given((leak,), alone, 0.9), other)
    assert found.word == ("abstain" if said else "named") and said in found.why


@pytest.mark.parametrize(("lasts", "sites"), [(1e7, ["damping", "gyro"]), (600.0, ["damping"])])
def test_an_event_that_stays_is_not_drawn_by_what_explains_something_else(lasts: float, sites: list[str]) -> None:
    """Each has as much alone as beside the other. What comes and goes may still be what a wrong law leaves."""
    gyro, law = event("gyro", (250.0, lasts)), replace(lag("damping"), kind="depends", driver="speed")
    said = told(Given((law, gyro), 1000.0, 0.9), Given((law,), 430.0, 0.4), Given((gyro,), 560.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


@pytest.mark.parametrize(("where", "sites"), [("feed", ["feed", "feed"]), ("valve", ["valve"])])
def test_an_event_beside_a_constant_error_of_its_site_is_a_level_before_and_after(where: str, sites: list[str]) -> None:
    """A feed was 7 % richer than its recipe, and 12 % more from some time on: the constant draws half of that."""
    off, richer = shift(where), event("feed", (250.0, 1e7))
    said = told(Given((off, richer), 1000.0, 0.9), Given((off,), 550.0, 0.4), Given((richer,), 600.0, 0.3))
    assert said.word == "named" and [h.site for h in said.certain] == sites


def test_a_store_and_a_dependence_are_not_told_by_name() -> None:
    """An outflow with another exponent was drawn by both."""
    store = replace(lag("inflow"), kind="store", driver="level")
    law = replace(lag("outflow"), kind="depends", driver="level")
    pair = Given((store, law), 500.0, 0.9)
    said = told(pair, Given((store,), 200.0, 0.4), Given((law,), 150.0, 0.3))
    assert said.word == "named" and asked_again(said).word == "abstain"
