"""Rivals write verdicts that can be scored; the oracle shows that an answer tells the whole truth."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import DataError
from benchmarks.hidden_effects.generate.folder import answer_file, generate, load_answers, record_file
from benchmarks.hidden_effects.rivals import RIVALS, bic, correlation, drift, judge, spline
from benchmarks.hidden_effects.rivals.base import Prepared
from benchmarks.hidden_effects.score.commands import run_method
from benchmarks.hidden_effects.score.outcome import classify
from benchmarks.hidden_effects.score.results import removed_share
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict, read_verdict


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One record: an air recovery sensor with a wrong gain."""
    made = tmp_path_factory.mktemp("rivals")
    generate(made, seed=27, count=1, jobs=1)
    return made


def test_with_the_term_of_the_answer_all_removable_error_goes(folder: Path, tmp_path: Path) -> None:
    """An answer tells the whole truth: the effect read back from it leaves the noise."""
    out = tmp_path / "v.json"
    judge("oracle", record_file(folder, "record_0000"), out, answer_file(folder, "record_0000"))
    verdict, answer = read_verdict(out), load_answers(folder)["record_0000"]
    assert isinstance(verdict, SubmittedVerdict)
    assert classify(answer, verdict) == "right"
    assert removed_share(answer, verdict) > 0.97


def test_a_rival_judges_a_file(folder: Path, tmp_path: Path) -> None:
    """From the table of a record to a verdict with an error block an output, at the noise where nothing is hidden."""
    record, out = tmp_path / "records" / "short.csv", tmp_path / "v.json"
    record.parent.mkdir()
    pd.read_csv(record_file(folder, "record_0000")).iloc[:1400].to_csv(record, index=False)
    judge("correlation", record, out)
    verdict = read_verdict(out)
    assert isinstance(verdict, SubmittedVerdict)
    level = verdict.error["level_m"]
    std = load_answers(folder)["record_0000"]["noise"]["std"]["level_m"]
    assert level.before == pytest.approx(std, rel=0.3)


def test_rivals_judge_a_folder_and_no_failure_stops_the_rest(folder: Path, tmp_path: Path) -> None:
    """As one by one: a record that can not be read is a crash of its own, what is done is not done again."""
    for part in ("records", "answers"):
        (tmp_path / part).mkdir()
    for name in ("record_0000", "record_0001"):
        answer = json.loads(answer_file(folder, "record_0000").read_text())
        answer_file(tmp_path, name).write_text(json.dumps(answer | {"record": name}))
    pd.read_csv(record_file(folder, "record_0000")).iloc[:1400].to_csv(
        record_file(tmp_path, "record_0000"), index=False
    )
    record_file(tmp_path, "record_0001").write_text("no,record\n")
    run_method(tmp_path, "correlation", "mine", "the command", jobs=2)
    verdicts = tmp_path / "runs" / "mine" / "verdicts"
    metas = [json.loads((verdicts / f"record_000{k}.meta.json").read_text())["status"] for k in (0, 1)]
    assert metas == ["ok", "crash"]
    assert "Error" in (verdicts / "record_0001.log").read_text()
    judge("correlation", record_file(tmp_path, "record_0000"), tmp_path / "alone.json")
    one, other = read_verdict(verdicts / "record_0000.json"), read_verdict(tmp_path / "alone.json")
    assert isinstance(one, SubmittedVerdict) and isinstance(other, SubmittedVerdict)
    assert one.model_copy(update={"seconds": other.seconds}) == other
    record_file(tmp_path, "record_0000").unlink()
    run_method(tmp_path, "correlation", "mine", "the command", jobs=2)  # nothing is left to do
    assert json.loads((verdicts / "record_0000.meta.json").read_text())["status"] == "ok"
    with pytest.raises(DataError, match="this label ran"):
        run_method(tmp_path, "correlation", "mine", "another", jobs=1)


def test_an_estimate_that_only_drifts_waits_for_no_responses(folder: Path, tmp_path: Path) -> None:
    """It needs the fit alone, which those that ask for candidates then share."""
    record = tmp_path / "records" / "short.csv"
    record.parent.mkdir()
    pd.read_csv(record_file(folder, "record_0000")).iloc[:1400].to_csv(record, index=False)
    for name, kept in (("drift", ["short.fit.pickle"]), ("bic", ["short.fit.pickle", "short.responses.pickle"])):
        judge(name, record, tmp_path / "v.json")
        assert sorted(file.name for file in (tmp_path / "cache").iterdir()) == kept
        assert isinstance(read_verdict(tmp_path / "v.json"), SubmittedVerdict)


def test_the_oracle_needs_the_answer(tmp_path: Path) -> None:
    """No rival gets it by accident."""
    assert RIVALS[-1] == "oracle"
    with pytest.raises(DataError, match="needs --answer"):
        judge("oracle", tmp_path / "record.csv", tmp_path / "v.json")


def _toy(residual_of: str) -> Prepared:
    """Two outputs, two process sites and a sensor; the residual is one of them times a driver, plus unit noise."""
    rng = np.random.default_rng(0)
    rows = 400
    air = rng.standard_normal(rows)
    depth = np.convolve(rng.standard_normal(rows), np.ones(20) / 4.0, mode="same")
    zero, one = np.zeros(rows), np.ones(rows)
    responses = {
        "entrainment": np.concatenate([one * 5.0, 2.0 * depth]),
        "bubble_size": np.concatenate([3.0 * depth, one * 4.0]),
        "grade_sensor": np.concatenate([one, zero]),
    }
    effect = {"nothing": 0.0, "entrainment": np.tile(air, 2) * responses["entrainment"],
              "C": 0.1 * np.tile(np.linspace(-1.0, 1.0, rows), 2)}[residual_of]  # fmt: skip
    slopes = np.column_stack([np.concatenate([one * 8.0, zero]), np.concatenate([80.0 * one, 30.0 * one])])
    noise = rng.standard_normal(2 * rows)
    residual = (effect if residual_of != "C" else effect * slopes[:, 1]) + noise
    late = {"grade_sensor": np.concatenate([np.gradient(air), zero])}
    drivers = {"air_flow": air, "froth_depth": depth / depth.std()}
    time = np.arange(600.0, 600.0 + 5.0 * rows, 5.0)
    outputs = ("concentrate_grade", "level_m")
    return Prepared(residual, slopes, drivers, outputs, np.ones(2), time, 2600.0, responses, late)


def test_rivals_find_what_lies_in_their_own_family() -> None:
    """A linear effect is named by correlation and selection, given a curve by the spline, and removed by all three."""
    p = _toy("entrainment")
    for method in (correlation, bic, spline):
        verdict = method.judge(p)
        assert (verdict["effects"][0]["site"], verdict["effects"][0]["driver"]) == ("entrainment", "air_flow")
        block = verdict["error"]["concentrate_grade"]
        assert block["before"] > 3.0 and block["after"] == pytest.approx(1.0, abs=0.25)


def test_a_drifting_estimate_is_regressed_on_time() -> None:
    """C rises by 20 % over the record: the smoothed estimate follows, and time explains it."""
    verdict = drift.judge(_toy("C"))
    assert (verdict["effects"][0]["site"], verdict["effects"][0]["driver"]) == ("coalescence", "time")
    assert verdict["error"]["concentrate_grade"]["after"] < 0.5 * verdict["error"]["concentrate_grade"]["before"]


def test_careful_rivals_are_quiet_on_white_noise() -> None:
    """With nothing but noise, selection, drift and spline say none."""
    p = _toy("nothing")
    quiet = replace(p, residual=p.residual - p.residual.mean())
    assert {m.judge(quiet)["verdict"] for m in (bic, drift, spline)} == {"none"}
