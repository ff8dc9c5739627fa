"""Sweeps on a cluster in this process: the rows are those of `run`, what fails becomes a row, what changed is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal

from adaptive_flot.errors import AdaptiveFlotError, ModelError, PluginError, StudyError
from adaptive_flot.greybox.stepping.compiling import compiled as machine_code
from adaptive_flot.runner.commands.runs import side_by_side
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.commands.runs.run_files import plain, run_summary
from adaptive_flot.runner.commands.runs.runs_table import read_runs, run_rows
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.studies import sweep as sweep_module
from adaptive_flot.studies import worker
from adaptive_flot.studies.folder import locked
from adaptive_flot.studies.study_file import load_study
from adaptive_flot.studies.sweep import Outcome, Rows, sweep
from tests.studies.conftest import WriteStudy

pytestmark = pytest.mark.usefixtures("at_hand")

PICKY = """
from pathlib import Path
from estimators.fixed import Fixed

class Picky(Fixed):
    def init(self, prior):
        if Path(__file__).with_name("broken").exists():
            raise ValueError("not today")
        return super().init(prior)
"""


def run(file: Path, out: str = "out") -> Outcome:
    return sweep(load_study(file), file.parent / out)


def test_rows_are_those_of_run_to_the_bit(write_study: WriteStudy, tmp_path: Path) -> None:
    """Two threads at once, the initial fit shared between estimators as a task of its own: nothing changes."""
    found = run(write_study())
    scenario = load_scenario(tmp_path / "short.yaml")
    alone = run_scenario(scenario, ["rpem", "fixed"], [1, 2, 3])
    apart = [*worker.TIMES, "code"]  # what depends on the machine, or on when a study went on
    rows = pd.DataFrame(run_rows(plain(run_summary(scenario, alone)))).drop(columns=apart, errors="ignore")
    rows = rows.fillna({c: 0 for c in rows if str(c).startswith("status_")})
    assert_frame_equal(found.table[rows.columns], rows, check_exact=True, check_dtype=False)
    assert (found.table["outcome"] == "ok").all() and found.table["run"].is_unique
    assert found.timings["run"].tolist() == found.table["run"].tolist()
    assert (found.timings["cpu_seconds"] > 0).all() and not {"seconds", "worker", "code"} & set(found.table.columns)


def test_a_finished_study_runs_nothing_and_a_grown_one_only_what_is_new(
    write_study: WriteStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = run(write_study({"seeds.count": 2}))
    grown = run(write_study())
    assert (first.from_before, grown.from_before, len(grown.table)) == (0, 4, 6)
    assert grown.table["seed"].tolist() == [1, 1, 2, 2, 3, 3]
    whole = run(write_study(), "whole")
    out = write_study().parent
    assert (out / "out" / "runs.parquet").read_bytes() == (out / "whole" / "runs.parquet").read_bytes()
    monkeypatch.setattr(worker, "run", None)  # nothing may run now
    again = run(write_study())
    assert again.from_before == 6
    assert_frame_equal(again.table, whole.table)


def test_progress_hears_of_every_run_once(write_study: WriteStudy) -> None:
    seen: list[str] = []
    totals: list[tuple[int, int]] = []

    def start(total: int, before: Rows) -> object:
        totals.append((total, len(before)))
        return lambda rows: seen.extend(row["run"] for row in rows)

    study = load_study(write_study())
    found = sweep(study, study.path.parent / "out", progress=start)  # type: ignore[arg-type]
    assert sorted(seen) == sorted(found.table["run"]) and totals == [(6, 0)]


MESSAGE = "picky.py, line 8: ValueError: not today; correct the plug-in"


def test_a_run_that_fails_is_a_row_and_can_be_tried_again(write_study: WriteStudy, tmp_path: Path) -> None:
    """A user's estimator that breaks in some of the runs does not stop the others, nor is it run again unasked."""
    (tmp_path / "picky.py").write_text(PICKY)
    (tmp_path / "broken").touch()
    study = write_study({"estimators": {"fixed": None, "mine": {"use": "picky:Picky"}}})
    first = run(study)
    failed = first.table[first.table["outcome"] == "failed"]
    assert failed["estimator"].tolist() == ["mine"] * 3 and set(failed["message"]) == {MESSAGE}
    assert failed.filter(like="fit_").isna().all(axis=None)
    (tmp_path / "broken").unlink()
    assert (run(study).table["outcome"] == "failed").sum() == 3
    retried = sweep(load_study(study), tmp_path / "out", retry_failed=True)
    assert retried.from_before == 3 and (retried.table["outcome"] == "ok").all()
    assert retried.table["run"].tolist() == first.table["run"].tolist()


def test_seed_without_a_start_fails_for_all_its_estimators(write_study: WriteStudy) -> None:
    """The plant has no steady state there: the shared fit says so once, and each run keeps the message."""
    level = {"profile": "random", "between": [0.01, 0.4], "every_s": 30, "seed": "per_run"}
    found = run(write_study(scenario={"inputs.level_setpoint_m": level, "seeds": [2]}))
    failed = found.table[found.table["outcome"] == "failed"]
    assert 0 < len(failed) < 6 and (failed.groupby("seed").size() == 2).all()
    assert failed["message"].str.startswith("RangeError: model 'flotation' has no steady state").all()


def test_user_files_beside_the_study_are_found(write_study: WriteStudy, tmp_path: Path) -> None:
    (tmp_path / "picky.py").write_text(PICKY)
    found = run(write_study({"estimators": {"mine": {"use": "picky:Picky", "start": "nominal"}, "fixed": None}}))
    mine, fixed = (found.table[found.table["estimator"] == name].reset_index() for name in ("mine", "fixed"))
    fits = [c for c in found.table.columns if c.startswith("fit_")]
    assert_frame_equal(mine[fits], fixed[fits], check_exact=True)


@pytest.mark.parametrize(
    ("estimators", "error", "words"),
    [
        ({"x": {"use": "rpem", "options": {"forgeting": 0.9}}}, PluginError, ["forgeting"]),
        ({"x": {"use": "rpem", "options": {"forgetting": 2.0}}}, ModelError, ["forgetting"]),
        ({"x": {"use": "nowhere:Nothing"}}, PluginError, ["nowhere"]),
    ],
)
def test_a_plugin_that_can_not_be_built_stops_the_study_before_it_starts(
    write_study: WriteStudy, estimators: dict[str, object], error: type[AdaptiveFlotError], words: list[str]
) -> None:
    file = write_study({"estimators": estimators})
    with pytest.raises(error) as caught:
        run(file)
    assert all(word in str(caught.value) for word in [str(file), *words])
    assert not list((file.parent / "out").rglob("*.parquet"))


def test_a_scenario_that_changes_under_way_stops_the_study(
    write_study: WriteStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker that starts later must not mix two scenarios in one table."""
    study = load_study(write_study())
    write_study(scenario={"measurements.level.noise_std": 5.0e-3})
    with pytest.raises(StudyError, match="is not here as it was"):
        sweep(study, study.path.parent / "out")


def test_changed_content_is_refused_with_what_changed(write_study: WriteStudy) -> None:
    run(write_study())
    with pytest.raises(StudyError, match=r"scenario 'short' .* has changed"):
        run(write_study(scenario={"measurements.level.noise_std": 5.0e-3}))
    assert run(write_study()).from_before == 6


def test_compiled_runs_have_the_fits_of_plain_ones_and_do_not_mix_with_them(
    write_study: WriteStudy, tmp_path: Path, libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What agrees to rounding only is another result, and the folder says so."""
    monkeypatch.setattr(machine_code, "cache_folder", lambda: libraries)
    problem = machine_code.compiler_problem()
    if problem is not None:
        pytest.skip(problem)
    study = load_study(write_study({"seeds.count": 2}))
    quick, plain = sweep(study, tmp_path / "quick", compiled=True).table, sweep(study, tmp_path / "plain").table
    assert list(libraries.glob("rpem_update-*.so"))
    fits = [c for c in map(str, plain.columns) if c.startswith("fit_")]
    np.testing.assert_allclose(quick[fits], plain[fits], rtol=1e-9)
    assert not set(quick["run"]) & set(plain["run"])
    with pytest.raises(StudyError, match="holds results with compiled = True, now it is False"):
        sweep(study, tmp_path / "quick")


@pytest.mark.slow
def test_results_do_not_depend_on_which_runs_went_side_by_side(
    write_study: WriteStudy, tmp_path: Path, libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Groups of any size, and a study that goes on after it was interrupted, give the same file to the byte."""
    monkeypatch.setattr(machine_code, "cache_folder", lambda: libraries)
    problem = machine_code.compiler_problem()
    if problem is not None:
        pytest.skip(problem)
    files = []
    for most in (1, 2, 16):
        monkeypatch.setattr(sweep_module, "MOST_TOGETHER", most)
        folder = tmp_path / f"groups-of-{most}"
        if most == 16:
            sweep(load_study(write_study({"seeds.count": 1})), folder, compiled=True)
        done = sweep(load_study(write_study()), folder, compiled=True)
        assert (done.table["outcome"] == "ok").all() and done.from_before == (2 if most == 16 else 0)
        files.append((folder / "runs.parquet").read_bytes())
    assert files[0] == files[1] == files[2]


@pytest.mark.slow
def test_a_seed_that_fails_beside_others_becomes_a_row(
    write_study: WriteStudy, tmp_path: Path, libraries: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine_code, "cache_folder", lambda: libraries)
    problem = machine_code.compiler_problem()
    if problem is not None:
        pytest.skip(problem)
    usual = side_by_side.run_side_by_side

    def second_fails(*arguments: Any) -> list[Any]:
        found = usual(*arguments)
        return [
            ValueError("not\ntoday") if realisation.seed == 2 else one
            for one, realisation in zip(found, arguments[3], strict=True)
        ]

    monkeypatch.setattr(worker, "run_side_by_side", second_fails)
    table = sweep(load_study(write_study({"estimators": ["rpem"]})), tmp_path / "out", compiled=True).table
    assert table["outcome"].tolist() == ["ok", "failed", "ok"]
    assert table["message"].tolist() == ["", "ValueError: not today", ""]


def test_two_sweeps_do_not_write_to_one_folder(write_study: WriteStudy) -> None:
    file = write_study()
    with locked(file.parent / "out"), pytest.raises(StudyError, match="another sweep"):
        run(file)
    assert run(file).from_before == 0


def test_compare_reads_a_study_finished_or_not(write_study: WriteStudy, tmp_path: Path) -> None:
    whole = run(write_study()).table
    table = read_runs([tmp_path / "out"])
    assert_frame_equal(table[whole.columns], whole, check_dtype=False)
    assert table["seconds"].tolist() == pd.read_parquet(tmp_path / "out" / "timings.parquet")["seconds"].tolist()
    (tmp_path / "out" / "timings.parquet").unlink()
    assert "seconds" not in read_runs([tmp_path / "out"])
