"""Numbers and examples of the documents are those of the code."""

from __future__ import annotations

import doctest
import re
from typing import get_args

import numpy as np
import pandas as pd
import pytest

import adaptive_flot as af
from adaptive_flot.discovery.results import Word
from adaptive_flot.processes.flotation.economics import Prices
from adaptive_flot.runner.scenario.keys import EconomicsPart
from benchmarks.hidden_effects.score.summary import rates
from benchmarks.plant_like.score import TOLD
from benchmarks.real_records.asked import SIMULATED
from tests.discovery.heated import Truth, tank_record
from tests.docs.pages import DOCS, ROOT, fences

PUBLISHED = ROOT / "benchmarks" / "other_processes" / "published"
ECONOMICS = DOCS / "guides" / "economics.md"


def test_the_worked_example_of_the_economics_comes_out() -> None:
    found = doctest.testfile(str(ECONOMICS), module_relative=False)
    assert (found.attempted, found.failed) == (8, 0)


def test_the_price_table_holds_the_scenario_keys_and_their_defaults() -> None:
    text = ECONOMICS.read_text(encoding="utf-8")
    rows = dict(re.findall(r"\| `(\w+_per_\w+)` \| ([\d.]+) \|", text))
    assert {key: float(value) for key, value in rows.items()} == EconomicsPart().model_dump()


def test_the_defaults_read_backwards() -> None:
    """2.5 cu per kg of chalcopyrite, 96.5 % payable, 0.346 kg of copper a kg."""
    assert Prices().metal / (0.346 * 0.965) == pytest.approx(7.48, abs=0.01)
    assert 63.546 / (63.546 + 55.845 + 2 * 32.06) == pytest.approx(0.346, abs=0.001)  # CuFeS2
    assert Prices().treatment / Prices().metal == pytest.approx(0.04)


def test_the_model_of_ones_own_is_the_file_beside_it() -> None:
    page = DOCS / "extending" / "model.md"
    assert (DOCS / "heated_tank" / "heated_tank.py").read_text(encoding="utf-8") in fences(page, "python")


def test_the_record_of_the_example_is_that_of_the_tank_apart() -> None:
    table = pd.read_csv(DOCS / "heated_tank" / "tank.csv")
    inputs = table[["power_W", "fan_speed_1_s"]].to_numpy()
    truth = tank_record(Truth(noise=0.0), inputs=inputs)
    assert np.std(table["temperature_K"] - truth.outputs[:, 0]) == pytest.approx(0.05, rel=0.1)


def test_every_word_of_a_verdict_is_explained() -> None:
    text = (DOCS / "discovery" / "verdicts.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `(\w+)` \| ", text, re.MULTILINE)) >= set(get_args(Word))


def test_the_sum_over_fresh_sets_of_other_processes_is_that_of_the_published_verdicts() -> None:
    """All sets that were fresh when they were judged count, and none is left out."""
    sets = [pd.read_csv(file).fillna("") for file in PUBLISHED.glob("discover_seed_*.csv")]
    found = pd.concat(sets)
    effects = found[found.truth != ""]
    told = int(effects.outcome.isin(TOLD).sum())
    wrong = int((found.outcome.isin(("wrong_name", "false_alarm")) & (found.verdict == "named")).sum())
    page = (DOCS / "results" / "other_processes.md").read_text(encoding="utf-8")
    assert len(sets) == 26 and f"{told} of {len(effects)} told" in page
    assert f"{wrong} of {len(found)} names wrong" in page
    assert f"{wrong} of {len(found)} names were wrong" in (ROOT / "README.md").read_text(encoding="utf-8")
    words = (DOCS / "discovery" / "verdicts.md").read_text(encoding="utf-8")
    assert f"{wrong} names of {len(found)} records were wrong" in words


@pytest.mark.parametrize(
    ("row", "what"),
    [
        ("| Discovery, 160 hidden effects of ordinary size |", "truth named or in a class of 3, single ordinary"),
        ("| ... 210 records with an effect |", "wrong name, of records with an effect"),
        ("| ... 60 records with none, or a drift |", "false alarm, of controls (none, drift)"),
        ("| ... 30 pairs of effects |", "pairs: both named, or in a class of three names each"),
    ],
)
def test_the_figures_of_the_readme_on_300_records_are_those_of_the_last_whole_run(row: str, what: str) -> None:
    """In percent, with its interval, to the digits that are printed."""
    rate = next(r for r in rates(pd.read_csv(SIMULATED)) if r.what == what)
    (line,) = (each for each in (ROOT / "README.md").read_text(encoding="utf-8").splitlines() if each.startswith(row))
    printed = re.search(r"([\d.]+) % \[([\d.]+), ([\d.]+)\]", line)
    assert printed is not None, line
    for text, exact in zip(printed.groups(), (rate.share, rate.low, rate.high), strict=True):
        digits = len(text.partition(".")[2])
        assert text == f"{100 * exact:.{digits}f}", line


@pytest.mark.slow
def test_what_a_shorter_memory_does_is_what_the_tutorial_says() -> None:
    """Fits of n, C and grade on seed 1, with the paper's forgetting factor and with 0.98."""
    options = {"paper": "rpem", "shorter": ("rpem", {"forgetting": 0.98})}
    summary = af.run("paper_scenario_1", estimators=options, seeds=[1]).summary.set_index("estimator")
    before, after = (summary.loc[name, ["n", "C", "concentrate_grade"]] for name in options)
    text = " ".join((DOCS / "tutorials" / "the_paper.md").read_text(encoding="utf-8").split())
    change = after - before
    said = re.search(
        r"from ([\d.]+) to ([\d.]+) %\. C gains ([\d.]+) points, to ([\d.]+) %, and n loses ([\d.]+)\.", text
    )
    assert said is not None
    found = [before.concentrate_grade, after.concentrate_grade, change.C, after.C, -change.n]
    # C follows the last digits of the linear algebra: 1.6 points on one machine are 1.3 on another
    assert [float(number) for number in said.groups()] == pytest.approx(found, abs=0.5)
