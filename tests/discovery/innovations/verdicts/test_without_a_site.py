"""Protects: what acts on a balance, where a model has no site for it, is not told as a probe; and a probe still is.

A basin through which water with a measured concentration flows. The records are simulated here by Euler's rule.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.further_sites.places import with_further_sites
from adaptive_flot.discovery.hypotheses import procedure
from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.hypotheses.judgement import WithoutSite
from adaptive_flot.discovery.hypotheses.procedure import compare
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.places import row_by_row
from adaptive_flot.discovery.innovations.places.row_by_row import unless_without_a_site
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import second_opinion
from adaptive_flot.discovery.results import State
from adaptive_flot.discovery.results.words import NO_SITE
from adaptive_flot.discovery.since_reference import changes
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.record import RecordSimulator

ROWS, DT, VOLUME = 600, 10.0, 1500.0
ON = slice(200, 400)
NOISE, WANDERS = 0.03, 0.002


def basin() -> Model:
    """What flows through, and what the probe shows."""

    def equations(m: Scope) -> None:
        salt = m.state("salt")
        share = m.site("mixed", m.parameter("share"), "process", unit="-")
        m.derivative("salt", share * m.input("flow") * (m.input("feed") - salt) / m.parameter("volume"))
        m.output("probe", m.site("probe", salt, "sensor", unit="g/L"))

    return Model(
        name="basin",
        states=(Quantity("salt", "g/L", "", -100.0, 100.0, scale=1.0),),
        inputs=(Quantity("flow", "L/s", "", 0.0, 50.0), Quantity("feed", "g/L", "", 0.0, 20.0)),
        parameters=(
            Parameter("volume", 1200.0, "L", "", lower=100.0, upper=1e4, scale=300.0, role="estimated"),
            Parameter("share", 1.0, "-", ""),
        ),
        outputs=(Quantity("probe", "g/L", "", scale=1.0),),
        equations=equations,
        max_step_s=DT,
        initial_guess={"salt": 3.0},
        starts_steady=False,
    )


def record(
    seed: int, *, fresh: float = 0.0, probe: float = 1.0, on: slice = ON, period: float = float("inf")
) -> Dataset:
    """Salt that is taken out by unmeasured fresh water [g/s], or a probe that shows a share of what is there.

    The water may come and go in a wave of a `period` [s].
    """
    rng = np.random.default_rng(seed)
    flow = np.repeat(rng.uniform(8.0, 16.0, ROWS // 20), 20)
    feed = np.repeat(rng.uniform(2.0, 4.0, ROWS // 30), 30)
    taken, shows = np.zeros(ROWS), np.ones(ROWS)
    taken[on], shows[on] = fresh, probe
    taken *= np.cos(2 * np.pi * DT * np.arange(ROWS) / period)
    salt, seen = 3.0, np.zeros(ROWS)
    for k in range(ROWS):
        seen[k] = shows[k] * salt + NOISE * rng.normal()
        if k + 1 < ROWS:
            salt += DT * (flow[k + 1] * (feed[k + 1] - salt) - taken[k]) / VOLUME
            salt += WANDERS * np.sqrt(DT) * rng.normal()
    return Dataset("basin", DT * np.arange(ROWS, dtype=float), DT, np.column_stack([flow, feed]), seen[:, None])


@cache
def fresh_water(seed: int) -> tuple[Search, Explanation, Told]:
    """What is told of water that runs for a third of the record; two tests ask what comes of it."""
    return judged(record(seed, fresh=6.0))


def judged(data: Dataset) -> tuple[Search, Explanation, Told]:
    model = basin()
    search = Search(model, data, (0,), noise_floor([data], (0,)), ("volume",))
    with np.errstate(all="ignore"):
        base = search.base(model.parameter_values)
        return search, base, judge(search, base, best_explanations(search, base))


@pytest.mark.parametrize("seed", [2])
def test_fresh_water_that_nobody_measures_is_no_probe(seed: int) -> None:
    search, base, told = fresh_water(seed)
    assert any(h.kind == "switch" for h in told.effects), "without the rule an event at a site is told"
    kept = unless_without_a_site(search, base, told)
    assert kept.word == "abstain" and not kept.effects
    assert kept.why.startswith("as if something takes from the balance of salt (")
    begins, ends = (float(t) for t in kept.why.split("(")[1].split(" s)")[0].split("-"))
    assert abs(begins - 2000.0) < 100.0 and abs(ends - 4000.0) < 100.0


def test_what_wanders_at_a_place_without_a_site_is_no_event_there(monkeypatch: pytest.MonkeyPatch) -> None:
    search, base, told = fresh_water(2)
    monkeypatch.setattr(row_by_row, "wanders", lambda further, explanation, event, gain: True)
    kept = unless_without_a_site(search, base, told)
    assert kept.word == "abstain" and "so that it wanders" in kept.why and NO_SITE not in kept.why


@pytest.mark.parametrize("seed", [2, 5])
def test_water_that_comes_and_goes_is_no_part_that_swings(seed: int) -> None:
    """Heat of 300 W, up and down, that nobody counts was told as the wall of a cold room."""
    search, base, told = judged(record(seed, fresh=8.0, on=slice(None), period=500.0))
    assert [h.kind for h in told.effects] == ["periodic"], "without the rule a part swings"
    kept = unless_without_a_site(search, base, told)
    said = kept.why if kept.beside is None else f"as if {kept.beside.words}"
    assert kept.word == "abstain" or kept.beside is not None
    assert re.search(r"something (adds|takes) .*the balance of salt \(up and down every (49\d|50\d) s\)", said), said


@pytest.mark.parametrize("seed", [2])
def test_a_probe_that_shows_less_stays_one(seed: int) -> None:
    search, base, told = judged(record(seed, probe=0.85))
    assert [h.site for h in told.effects] == ["probe"]
    assert unless_without_a_site(search, base, told) is told


def test_what_is_no_event_is_not_asked() -> None:
    search, base, told = judged(record(3))
    assert not any(h.kind == "switch" for h in told.effects)
    assert unless_without_a_site(search, base, told) is told


def test_a_model_with_further_sites_is_the_same_model() -> None:
    """Reduction: with nothing added it gives the same run."""
    data, plain = record(4), basin()
    balanced = with_further_sites(plain)
    assert [s.name for s in balanced.sites][-1] == "balance of salt"
    x0 = np.array([3.0])
    one, two = (RecordSimulator(m, DT).outputs(data, x0, plain.parameter_values) for m in (plain, balanced))
    np.testing.assert_allclose(one, two, rtol=1e-12)


ALWAYS = slice(None)


@pytest.mark.parametrize("seed", [0, 1])
def test_since_a_reference_fresh_water_is_no_probe_though_it_runs_all_the_time(seed: int) -> None:
    """3 g/s of 1500 L. Before, the probe was told, 0.25 g/L too low: by free runs, or by process noise."""
    new, old = record(10 + seed, fresh=3.0, on=ALWAYS), record(seed)
    found = find_changes(basin(), [new], [old]).verdict
    assert found.word in ("abstain", "class")  # beside what wanders the probe may be as good
    assert found.word == "abstain" or found.members == (("probe", "constant"), ("balance of salt", "constant"))
    said = re.search(r"something takes (\S+) g/L/s from the balance of salt", found.reason.partition("Error")[0])
    assert said is not None, found.reason
    assert float(said[1]) == pytest.approx(3.0 / VOLUME, rel=0.1)


@pytest.mark.parametrize("seed", [1, 3])
def test_what_stands_beside_a_name_takes_nothing_back(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """A name with a second explanation is no veto: it was taken for one, with an empty reason."""
    beside = WithoutSite("balance of salt", "constant", "something takes salt")
    monkeypatch.setattr(changes, "unless_without_a_site", lambda search, base, told: replace(told, beside=beside))
    new, old = record(10 + seed, fresh=1.0, on=ALWAYS), record(seed)
    found = find_changes(basin(), [new], [old]).verdict
    assert "reference, ." not in found.reason and not any("it is ." in note for note in found.notes)
    assert found.word in ("named", "class")


def test_since_a_reference_a_probe_that_shows_less_all_the_time_is_one() -> None:
    new, old = record(10, probe=0.85, on=ALWAYS), record(0)
    found = find_changes(basin(), [new], [old]).verdict
    assert found.word == "named" and found.effects[0].effect.site == "probe"


def test_the_comparison_alone_tells_a_balance_from_the_sites(monkeypatch: pytest.MonkeyPatch) -> None:
    """And it does so by that rule alone."""
    new, old = record(10, fresh=6.0, on=ALWAYS), record(0)
    found = compare(basin(), [new], [old]).verdict
    assert (
        found.word == "abstain" and "takes 0.004" in found.reason and "Nearest at a site: probe offset" in found.reason
    )
    monkeypatch.setattr(procedure, "unless_without_a_site", lambda c, rows, blocks, null, judged, *_: judged)
    assert compare(basin(), [new], [old]).verdict.word == "named"


def test_what_would_be_too_large_a_class_is_told_in_a_note(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pump that gave less and less was among three parts, and a place would have been the fourth: all was lost."""
    why = "3 parts explain it about as well, or it is as if something takes salt"
    monkeypatch.setattr(
        changes,
        "unless_without_a_site",
        lambda search, base, told: replace(told, word="abstain", certain=(), open=(), why=why),
    )
    found = find_changes(basin(), [record(12, probe=0.85)], [record(2)]).verdict
    (note,) = (n for n in found.notes if n.startswith(f"With process noise {why}."))
    assert found.word == "abstain" and not found.effects
    assert "Probe is " in note or "Probe shows " in note


def test_an_event_that_a_rule_takes_back_is_said_where_the_model_has_no_site(monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole program, and a rule that takes back whatever is told of the parts."""

    def taken_back(state: State, search: Search, base: Explanation, told: Told) -> Told:
        return replace(told, word="abstain", certain=(), open=(), why="a rule says so")

    monkeypatch.setattr(second_opinion, "_by_the_rules", taken_back)
    verdict = discover(basin(), record(2, fresh=6.0), processes=1).verdict
    assert verdict.word == "abstain" and not verdict.effects
    assert re.search(
        r"It is as if something takes from the balance of salt \((19\d\d|20\d\d)-\d+ s\)[^:]*: the model has no site",
        verdict.reason,
    ), verdict.reason
