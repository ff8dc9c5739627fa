"""Protects: how often a test tells each alternative is said in one short sentence, however many there are."""

import numpy as np

from adaptive_flot.discovery.results.experiment import Experiment, Pair, _powers, _shared


def sites(count: int) -> list[tuple[tuple[str, str], ...]]:
    return [((f"site_{i}", "time"),) for i in range(count)]


def test_a_few_are_all_listed() -> None:
    assert _powers(sites(3), (0.9, 0.0, 0.0)) == "site_0 by time in 90 %, site_1 by time in 0 %, site_2 by time in 0 %"


def test_of_many_those_that_are_hardly_told_count_together() -> None:
    power = (0.9, 0.0, 0.03, 0.0, 0.2, 0.01)
    said = _powers(sites(6), power)
    assert said == "site_0 by time in 90 %, site_4 by time in 20 %, each of the other 4 in at most 3 %"


def test_where_none_is_told_that_is_said_once() -> None:
    assert _powers(sites(6), (0.0,) * 6) == "each of all 6 in at most 0 %"
    assert _powers(sites(6), (0.9,) * 5 + (0.0,)).count("site_") == 6


def test_a_test_that_tells_nothing_is_not_praised() -> None:
    """Twice "in 0 %", and "would differ by about 0": two names of one thing. It says so."""
    one, other = sites(2)
    test = Experiment(
        "step of force", 1.0, np.zeros((45, 1)), (("force", "N"),), (), (one, other), np.ones(1),
        (Pair(one, other, 0.2),), (), 10.0, (0.0, 0.0),
    )  # fmt: skip
    said = str(test)
    assert said.startswith("No test tried would tell any of these apart: site_0 by time, or site_1 by time.")
    assert "differ by about 0" in said and "in 0 %" not in said


def test_what_all_alternatives_have_is_said_once() -> None:
    """Four sets of three effects filled half a page, and the first of each was the same."""
    one, other, third = sites(3)
    sets = [(*one, *other), (*one, *third)]
    test = Experiment(
        "step of force", 1.0, np.zeros((45, 1)), (("force", "N"),), (), tuple(sets), np.ones(1),
        (Pair(sets[0], sets[1], 30.0),), (), 10.0, (0.9, 0.85),
    )  # fmt: skip
    said = str(test)
    assert said.count("site_0 by time") == 1 and "All have site_0 by time, beside what is listed." in said
    assert "site_1 by time in 90 %, site_2 by time in 85 %" in said
    assert "The closest two, site_1 by time and site_2 by time, would differ by about 30" in said


def test_a_set_that_is_part_of_another_keeps_its_name() -> None:
    one, other = sites(2)
    assert _shared([one, (*one, *other)]) == ()
    assert _shared(sites(2)) == ()
