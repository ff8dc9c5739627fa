"""`af.run`: what goes in as names, classes and options comes out as one table, figures, a page and files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from matplotlib import pyplot
from matplotlib.figure import Figure

import adaptive_flot as af
from adaptive_flot.api.runs import Runs
from adaptive_flot.errors import AdaptiveFlotError, PluginError, ResultError, ScenarioError
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.runs_table import read_runs
from adaptive_flot.runner.scenario.scenario import Scenario
from estimators.fixed import Fixed
from estimators.rpem import Rpem
from tests.runner.conftest import edited


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    """Two minutes of the cell, with the options of rpem that a class has unless told otherwise."""
    file = tmp_path_factory.mktemp("scenario") / "short.yaml"
    file.write_text(yaml.safe_dump(edited({"estimators.rpem.options": {"forgetting": 0.995}}), sort_keys=False))
    return af.load_scenario(file)


@pytest.fixture(scope="module")
def runs(short: Scenario) -> Runs:
    """Five seeds, as many as a figure of the fits wants."""
    return af.run(short, estimators=["fixed", Rpem], seeds=range(1, 6))


def test_the_table_holds_the_fits_of_the_command(runs: Runs, short: Scenario) -> None:
    """A class run from Python gives to the bit what its name gives from the command line."""
    plain = run_scenario(short, ["fixed", "rpem"], [1])
    row = runs.table.set_index(["estimator", "seed"])
    for one, name in zip(plain, ("fixed", "Rpem"), strict=True):
        assert {key: row.loc[(name, 1), key] for key in one.fit} == one.fit
    assert len(runs) == len(runs.table) == 10


def test_the_summary_is_the_median_over_the_seeds(runs: Runs) -> None:
    own = runs.table[runs.table["estimator"] == "Rpem"]
    row = runs.summary.set_index("estimator").loc["Rpem"]
    assert (row["seeds"], row["n"]) == (5, own["n"].median())


def test_a_fit_and_an_account_of_one_name_are_both_kept(runs: Runs) -> None:
    """With economics, `recovery` may be a driving output and is an entry of the account: two different numbers."""
    one = replace(runs.runs[0], fit={"n": 90.0, "recovery": 80.0}, account={"recovery": 0.7})
    assert Runs(runs.scenario, (one,)).table[["n", "fit_recovery", "recovery"]].to_numpy().tolist() == [[90, 80, 0.7]]


def test_text_and_html_are_short_and_hold_what_counts(runs: Runs) -> None:
    """A notebook prints a result that nobody asked to print: a few lines, not the whole scenario."""
    for shown in (repr(runs), runs._repr_html_()):
        assert len(shown) < 2000
        for word in ("short", "Rpem", "concentrate_grade", "5 seeds"):
            assert word in shown


@pytest.mark.parametrize("kind", ["parameters", "outputs", "inputs", "fits"])
def test_every_plot_is_a_figure_without_the_state_of_pyplot(runs: Runs, kind: str) -> None:
    figure = runs.plot(kind)
    assert isinstance(figure, Figure)
    assert figure.axes
    assert pyplot.get_fignums() == []


def test_report_and_files_are_those_of_the_command(runs: Runs, tmp_path: Path) -> None:
    assert "Rpem" in runs.report(tmp_path / "page.html").read_text()
    folder = runs.save(tmp_path / "files")
    assert len(list(folder.glob("*.csv"))) == len(runs)
    assert len(read_runs([folder])) == len(runs)


def test_options_change_the_run_and_show_in_its_name(short: Scenario) -> None:
    chosen = {"slow": ("rpem", {"forgetting": 0.999}), "as it is": "rpem"}
    fits = af.run(short, estimators=chosen, seeds=[1]).table.set_index("estimator")["n"].to_dict()
    assert fits["slow"] != fits["as it is"]
    bare = af.run(short, estimators=("rpem", {"forgetting": 0.999}), seeds=[1]).table
    assert bare["estimator"].tolist() == ["rpem (forgetting=0.999)"]
    assert bare["n"].tolist() == [fits["slow"]]


def test_a_class_that_no_file_holds_runs(short: Scenario) -> None:
    class Local(Fixed):
        """As written in a cell of a notebook."""

    table = af.run(short, estimators=Local, seeds=[1]).table
    assert table["estimator"].tolist() == ["Local"]


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"estimators": ["rpme"]}, ScenarioError, "unknown estimator 'rpme'; did you mean 'rpem'"),
        ({"estimators": [3]}, PluginError, "3 is a int; give a name, a class"),
        ({"estimators": ["rpem", "rpem"]}, PluginError, "'rpem' is given twice"),
        ({"estimators": [("rpem", 3)]}, PluginError, "options 3 are no mapping"),
        ({"estimators": [(Rpem, {"forgeting": 1})]}, PluginError, "no option 'forgeting'; did you mean 'forgetting'?"),
        ({"controllers": "schedul"}, ScenarioError, "did you mean 'schedule'"),
        ({"seeds": 5}, ScenarioError, "seeds: 5; give a list"),
        ({"seeds": [1.5]}, ScenarioError, "1.5 is no whole number"),
        ({"seeds": [-1]}, ScenarioError, "-1 is negative"),
    ],
)
def test_a_wrong_choice_is_one_line(given: dict[str, Any], error: type[AdaptiveFlotError], words: str) -> None:
    with pytest.raises(error) as caught:
        af.run("paper_scenario_1", **given)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_plot_that_is_not_there_says_which_are(runs: Runs, short: Scenario) -> None:
    calls: Iterable[tuple[tuple[str, ...], str]] = [
        (("fit",), "did you mean 'fits'"),
        (("inputs", "pi"), "no run with the controller 'pi'"),
    ]
    for arguments, words in calls:
        with pytest.raises(ResultError, match=words):
            runs.plot(*arguments)
    with pytest.raises(ResultError, match="5 seeds or more"):
        af.run(short, estimators="fixed", seeds=[1]).plot("fits")
