"""With a reference: an event reaches every output that has changed, and a cause explains most of the change."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.hypotheses.judgement import Word
from adaptive_flot.discovery.hypotheses.telling import ABOVE_USUAL
from adaptive_flot.discovery.innovations.verdicts.cause import MOST, _too_many_parts
from adaptive_flot.discovery.innovations.verdicts.rivals import hardly_explained, two_and_more
from adaptive_flot.discovery.results import NamedEffect, OutputChange, Verdict
from adaptive_flot.discovery.since_reference import changes
from adaptive_flot.discovery.since_reference.taken_back import unless_contradicted, unless_much_is_left
from adaptive_flot.greybox.effects import Effect


@pytest.mark.parametrize(
    ("before", "after", "hardly"),
    [
        (5.0, 4.9, True),  # five times as large as on the reference, and the event does nothing to it
        (6.9, 6.1, True),  # (37 - 1) / (48 - 1): three quarters of what is unusual are left
        (5.0, 1.2, False),  # the event brings it down
        (5.0, 3.0, False),  # a third is left, but the event is at work there
        (1.5, 1.5, False),  # about as on the reference: nothing has changed there
    ],
)
def test_an_event_must_explain_half_of_what_is_unusual(before: float, after: float, hardly: bool) -> None:
    change = OutputChange("flow", "m3/s", before, after, 1.0, (0.0, 0.1))
    assert hardly_explained((change,), ABOVE_USUAL) == hardly


@pytest.mark.parametrize(
    ("before", "after", "hardly"),
    [
        (5.0, 1.0, False),  # as on the reference
        (5.0, 2.0, False),  # (4 - 1) / (25 - 1): an eighth of what is unusual is left
        (5.0, 3.0, True),  # a third of it is left
        (1.4, 1.4, False),  # about as on the reference: there is nothing to explain
    ],
)
def test_a_cause_must_explain_most_of_what_is_unusual(before: float, after: float, hardly: bool) -> None:
    change = OutputChange("flow", "m3/s", before, after, 1.0, (0.0, 0.1))
    assert hardly_explained((change,), ABOVE_USUAL, MOST) == hardly


@dataclass(frozen=True)
class Judged:
    """A judgement, its word alone."""

    word: str = "named"


@dataclass(frozen=True)
class Compared:
    """What is asked of a comparison."""

    verdict: Verdict
    judged: Judged = Judged()
    calibration: Any = field(default_factory=lambda: SimpleNamespace(model=None))
    model: Any = None


@pytest.mark.parametrize(
    ("before", "after", "sites", "word"),
    [
        (1.2, 0.9, (), "abstain"),  # hardly above the reference, and not confirmed
        (1.2, 0.9, ("gauge",), "named"),  # confirmed
        (1.2, 0.9, ("gauge", "open"), "named"),  # it is in the best explanation, though others are as good
        (5.0, 1.1, (), "named"),  # far above the reference, and brought down to it
        (5.0, 2.2, (), "abstain"),  # far more is left than the reference has, and nothing else speaks for it
        (5.0, 2.2, ("gauge",), "named"),
        (5.0, 3.0, ("pump",), "abstain"),  # much is left, and another part explains more
        (5.0, 1.1, ("pump",), "named"),  # another part is named, but nothing is left
    ],
)
def test_a_name_of_the_comparison_is_taken_back_where_the_innovations_form_does_not_know_it(
    before: float, after: float, sites: tuple[str, ...], word: str
) -> None:
    effect: Any = SimpleNamespace(effect=SimpleNamespace(site="gauge", driver="time"))
    error = (OutputChange("level", "m", before, after, 1.0, (0.1, 0.3)),)
    compared: Any = Compared(
        Verdict(word="named", reason="Gauge shows more.", effects=(effect,), members=(), error=error, split="fresh")
    )
    is_open = "open" in sites
    found = tuple(SimpleNamespace(site=s, label=s, driver="time") for s in sites if s != "open")
    best = SimpleNamespace(hypotheses=found)
    told: Any = SimpleNamespace(
        word="abstain" if is_open else "named" if sites else "none",
        effects=() if is_open else found,
        alike=(best,),
        best=best,
    )
    assert unless_contradicted(compared, told).verdict.word == word


@pytest.mark.parametrize(
    ("after", "given", "word"),
    [
        ((1.1, 0.9), "named", "named"),
        ((3.5, 3.2), "named", "named"),
        ((1.2, 4.3), "named", "abstain"),
        ((4.0, 4.3), "named", "abstain"),
        ((4.6, 1.2), "class", "class"),
        ((4.0, 4.3), "class", "abstain"),
        ((1.1, 8.3), "class", "abstain"),
    ],
)
def test_a_name_that_leaves_four_times_the_error_of_the_reference_is_not_told(
    after: tuple[float, float], given: Word, word: str
) -> None:
    """A meter that is off, told as a charger that leaks: nine tenths of the square are gone, and still much is left.

    And a bypass between two tanks, which no part of the model has, told as a pipe: one level of three stayed 6.5 times
    as far off. A name must leave little in each output, a class on the average of them, and not much in any.
    """
    error = tuple(
        OutputChange(n, "V", 20.0, a, 1.0, (0.5, 0.9)) for n, a in zip(("volts", "amperes"), after, strict=True)
    )
    compared: Any = Compared(
        Verdict(word=given, reason="Charger does not go below 1 A.", effects=(), members=(), error=error, split="fresh")
    )
    verdict = unless_much_is_left(compared).verdict
    assert verdict.word == word
    if word == "abstain":
        assert verdict.reason.startswith("Something differs from the reference, and it is not told what: ")
        assert f"the error of amperes is still {after[1]} times" in verdict.reason
        assert "The nearest: charger does not go below 1 A." in verdict.reason


@pytest.mark.parametrize(
    ("driver", "spells", "left", "word"),
    [("time", 1, 2.4, "named"), ("time", 1, 2.9, "abstain"), ("time", 3, 2.9, "named"), ("load", 1, 2.9, "named")],
)
def test_one_change_comes_nearer_to_the_errors_of_the_reference(
    driver: str, spells: int, left: float, word: str
) -> None:
    """Coolant that came 8 K warmer was named as 21 % less of it: the temperature stayed 2.9 times as far off.

    A lid that is opened again and again leaves as much, and is confirmed each time.
    """
    settings = {"count": float(spells), "width": 1.0} if driver == "time" else {}
    effect = Effect("cooling", driver, "switch" if settings else "shift", {"amplitude": -0.2}, settings)
    error = (OutputChange("temperature", "K", 15.0, left, 1.0, (0.5, 0.9)),)
    verdict = Verdict("named", "Cooling is 21 % smaller.", (NamedEffect(effect, "", {}, ()),), (), error, "fresh")
    compared: Any = Compared(verdict)
    assert unless_much_is_left(compared).verdict.word == word


@pytest.mark.parametrize(
    ("left", "after", "site", "searched"),
    [
        (15.0, 1.2, "friction", True),
        (15.0, 1.2, "encoder", False),  # another place, which the innovations form has not been asked about
        (15.0, 1.8, "friction", False),
        (2.0, 1.0, "friction", False),  # little was left
    ],
)
def test_a_short_record_is_searched_for_another_shape_at_the_place_that_is_told(
    monkeypatch: pytest.MonkeyPatch, left: float, after: float, site: str, searched: bool
) -> None:
    """Dry friction was found at its place by a turn of a given width. It left 15 times the noise: nothing was told."""

    def with_error(error: float, place: str) -> Any:
        effect: Any = SimpleNamespace(effect=SimpleNamespace(site=place, driver="speed"))
        change = OutputChange("position", "m", 100.0, error, 1.0, (0.5, 0.9))
        return Compared(Verdict("named", "Friction turns.", (effect,), (), (change,), split="fresh"))

    found = with_error(after, site)
    monkeypatch.setattr(changes, "with_searched_effect", lambda *given: found)
    before = with_error(left, "friction")
    record: Any = None
    asked = changes._of_another_shape(before, record, 1, lambda stage: None, 60.0)
    assert asked is (found if searched else before)
    assert changes._of_another_shape(before, record, 1, lambda stage: None, 0.0) is before


@pytest.mark.parametrize(
    ("parts", "told", "many"),
    [
        (("analyser", "feed", "pump", "strength"), ("feed", "pump", "strength"), True),  # the right one is left out
        (("feed", "pump", "strength"), ("pump",), False),  # a class of free runs, narrowed
        ((), ("pump",), False),  # free runs show nothing
    ],
)
def test_a_part_that_free_runs_do_not_tell_from_three_others_is_not_left_out(
    parts: tuple[str, ...], told: tuple[str, ...], many: bool
) -> None:
    found = [SimpleNamespace(hypothesis=SimpleNamespace(site=s)) for s in parts]
    compared: Any = SimpleNamespace(judged=SimpleNamespace(parts=found))
    said: Any = SimpleNamespace(effects=[SimpleNamespace(site=s) for s in told])
    assert _too_many_parts(compared, said) == many


@pytest.mark.parametrize(
    ("sites", "opened", "after", "said"),
    [
        (("cooler", "reaction"), False, 2.5, True),
        (("cooler", "reaction"), False, 1.5, False),
        (("cooler", "cooler"), False, 2.5, False),  # its level before an event, and after it
        (("cooler",), False, 2.5, False),
        (("cooler",), True, 2.5, True),
    ],
)
def test_two_effects_that_leave_far_more_than_noise_are_not_told(
    sites: tuple[str, ...], opened: bool, after: float, said: bool
) -> None:
    told: Any = SimpleNamespace(certain=[SimpleNamespace(site=s) for s in sites], open=[object()] if opened else [])
    assert two_and_more(told, (OutputChange("temperature", "K", 5.0, after, 1.0, (0.0, 0.0)),)) == said
