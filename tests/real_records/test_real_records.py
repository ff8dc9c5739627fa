"""Protects the models of the benchmark on real records: they run, and their sites are what the judge asks for."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.discovery.results import Verdict, Word
from adaptive_flot.greybox import Dataset, Model
from adaptive_flot.greybox.stepping.record import RecordSimulator
from benchmarks.hidden_effects.score.summary import rates
from benchmarks.real_records import __main__ as judging
from benchmarks.real_records import air_handling_unit, electric_drives, heat_exchanger, lamp, unchanged
from benchmarks.real_records.__main__ import worth_of
from benchmarks.real_records.asked import (
    PAIRS,
    PLANT_LIKE,
    SIMULATED,
    Judged,
    of_measured_records,
    of_simulated_records,
)

ROOT = Path(__file__).parents[2]
INPUTS = {
    "air handling unit": [15.0, 22.0, 0.3, 0.2, 0.1],
    "electric drives": [1.0],
    "heat exchanger": [0.3],
    "lamp over a plate": [8.0],
}


@pytest.mark.parametrize("module", [air_handling_unit, electric_drives, heat_exchanger, lamp])
def test_each_model_runs_to_rest(module: object) -> None:
    """Under constant inputs the outputs stay finite, and stop moving."""
    model: Model = module.make_model()  # type: ignore[attr-defined]
    n, dt = 400, 10 * model.max_step_s
    inputs = np.tile(INPUTS[model.name], (n, 1))
    data = Dataset("rest", dt * np.arange(n, dtype=np.float64), dt, inputs, np.zeros((n, len(model.outputs))))
    x0 = np.array([model.initial_guess[s.name] for s in model.states])
    outputs = RecordSimulator(model, dt).outputs(data, x0, model.parameter_values)
    assert np.isfinite(outputs).all()
    assert np.abs(np.diff(outputs[-10:], axis=0)).max() < 1e-3


def test_every_fault_is_at_a_site_of_the_model() -> None:
    sites = {s.name for s in air_handling_unit.make_model().sites}
    assert {part for part, _ in air_handling_unit.TRUTH.values()} <= sites
    assert {*air_handling_unit.SAME_PART, *air_handling_unit.SAME_PART.values()} <= sites
    assert electric_drives.TRUTH[0] in {s.name for s in electric_drives.make_model().sites}


@pytest.mark.parametrize(
    ("word", "sites", "worth"),
    [
        ("abstain", set(), "open"),
        ("named", {"valve"}, "right"),
        ("named", {"valve", "sensor"}, "wrong"),
        ("named", {"sensor"}, "wrong"),
        ("class", {"valve", "sensor"}, "right"),
        ("class", {"valve", "sensor", "damper"}, "wide"),
        ("class", {"sensor", "damper"}, "wrong"),
    ],
)
def test_a_verdict_is_worth_what_it_says_of_the_part_at_fault(word: Word, sites: set[str], worth: str) -> None:
    """No wrong part counts as right, and a class that holds the right part is never a wrong name."""
    assert worth_of("valve", Verdict(word, ""), sites) == worth


def test_the_figures_asked_for_come_from_the_verdicts() -> None:
    """A wrong name, a lamp that is named and an error above its target are each told as not met; the rest as met."""
    judged = [
        Judged("air handling a", "valve", Verdict("named", "", seconds=10.0), "right"),
        Judged("air handling b", "valve", Verdict("abstain", "", seconds=10.0), "open"),
        Judged("heat exchanger", "heating", Verdict("named", "", seconds=10.0), "right", 0.49),
        Judged("cascaded tanks", "spill", Verdict("class", "", seconds=10.0), "open", 0.2443),
        Judged("lamp", "not known", Verdict("named", "", seconds=100.0), "wrong"),
    ]
    met = {a.figure: a.met for a in of_measured_records(judged, ["air handling a", "air handling b"])}
    assert met == {
        "wrong names, measured records": False,
        "air handling: right part, or a class of two": False,
        "heat exchanger: effect": True,
        "heat exchanger: error run on": True,
        "cascaded tanks: error run on": False,
        "lamp: verdict": False,
        "cascaded tanks: verdict": False,
        "measured records: seconds, median and 95 %": False,
    }


def test_published_figures_are_those_of_the_last_table() -> None:
    """Each long run has its published verdicts, none of its figures is missing, and they are not of an earlier commit.

    The table that comes first in the list of tables is the last one. `make bench-measured` told an earlier one.
    """
    figures = {a.figure: a for a in of_simulated_records()}
    assert len(figures) == 9
    listed = (SIMULATED.parent / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(discover_\w+\.csv)` \| 0 to 299 \|", listed, re.MULTILINE)[0] == SIMULATED.name
    page = (ROOT / "docs" / "results" / "plant_like.md").read_text(encoding="utf-8")
    commit, seed = re.findall(r"^\| \*\*(\w+), (\d+)\*\* \|", page, re.MULTILINE)[0]
    assert PLANT_LIKE.name == f"discover_{commit}_seed_{seed}.csv"
    again = rates(pd.read_csv(PAIRS))
    assert (pd.read_csv(PAIRS).category == "pair").sum() == 30
    for what, figure in (("both named, or", "both told"), ("one effect told", "what is certain")):
        (rate,) = (r for r in again if r.what.startswith(f"pairs: {what}"))
        assert figures[f"pairs of the 300: {figure}, again"].measured == str(rate)
    assert figures["the 300: told"].by == f"{SIMULATED.stem.split('_')[1]}, published"
    assert figures["plant-like: told"].by == f"{commit}, published"


def test_each_part_of_an_unchanged_record_is_asked_about_once_and_is_a_reference_once() -> None:
    """With the part before it as the reference, the first with the last; no row is left out or used twice."""
    n = 10
    whole = Dataset("whole", np.arange(n, dtype=np.float64), 1.0, np.zeros((n, 1)), np.zeros((n, 1)))
    found = list(unchanged._neighbours("whole", lamp.make_model(), whole, 3))
    assert [name for name, *_ in found] == [
        "whole, part 1 -> 2 of 3",
        "whole, part 2 -> 3 of 3",
        "whole, part 3 -> 1 of 3",
    ]
    for parts in ([old for *_, old, _ in found], [new for *_, new in found]):
        np.testing.assert_array_equal(np.sort(np.concatenate([part.time for part in parts])), whole.time)
    assert all(old.time[0] != new.time[0] for *_, old, new in found)


@pytest.mark.parametrize("main", [judging.main, unchanged.main])
def test_without_the_records_one_line_says_so(main: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(tmp_path) == 2  # type: ignore[operator]
    said = capsys.readouterr()
    assert said.out == "" and len(said.err.splitlines()) == 1 and str(tmp_path) in said.err
