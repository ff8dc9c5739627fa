"""Replaying a record of known truth: errors at the noise level, and a test block that nobody has seen."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.contracts import Status, full_parameters
from adaptive_flot.contracts.batch import Identifiability
from adaptive_flot.errors import DataError, ModelError, PluginError
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.plugins import DEFAULT_ESTIMATOR, OF_A_RECORD
from adaptive_flot.processes.flotation import make_model as make_cell
from adaptive_flot.processes.flotation import read_cell
from adaptive_flot.processes.registry import make_model
from adaptive_flot.report.estimate.answer import NOTHING_FITTED, title
from adaptive_flot.report.estimate.page import estimate_report
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.commands.estimate import RecordEstimate, estimate_record
from adaptive_flot.runner.commands.estimate_files import estimate_summary, save_fitted_cell, write_replays
from adaptive_flot.runner.commands.record_blocks import Blocks, read_blocks
from adaptive_flot.runner.commands.runs.run_files import plain
from adaptive_flot.runner.results.replay_table import ReplayErrors
from tests.runner.records import NOISE, TRUTH, PlantRecord, plant_record

CUT = 150


@pytest.fixture(scope="session")
def plant(model: Model) -> PlantRecord:
    return plant_record(model)


@pytest.fixture(scope="session")
def result(model: Model, plant: PlantRecord) -> RecordEstimate:
    return estimate_record(plant.blocks(CUT), model)


def errors(result: RecordEstimate) -> dict[tuple[str, str, str], ReplayErrors]:
    return {(r.estimator, e.block, e.output): e for r in result.replays for e in r.errors}


@pytest.mark.parametrize("output", NOISE)
@pytest.mark.parametrize("block", ["fit", "test"])
def test_errors_of_the_batch_fit_are_the_noise_level(result: RecordEstimate, block: str, output: str) -> None:
    found = errors(result)["pem", block, output]
    assert found.one_step == pytest.approx(NOISE[output], rel=0.2)
    assert found.free_run == pytest.approx(NOISE[output], rel=0.2)
    assert 0.005 < found.ljung_box_p, "nothing but noise is left"


def test_nominal_parameters_leave_more_than_noise_in_the_grade(result: RecordEstimate) -> None:
    """The level does not depend on n and C; the grade does, and its innovations are not white."""
    found = errors(result)
    for block in ("fit", "test"):
        assert found["fixed", block, "concentrate_grade"].free_run > 3 * NOISE["concentrate_grade"]
        assert found["fixed", block, "concentrate_grade"].ljung_box_p < 1e-6
        assert found[DEFAULT_ESTIMATOR, block, "concentrate_grade"].one_step < 1.3 * NOISE["concentrate_grade"]


def test_parameters_are_those_of_the_record_within_their_spread(result: RecordEstimate) -> None:
    for replay in result.replays:
        for label, (value, std) in replay.parameters.items():
            if replay.estimator == "fixed":
                assert (value, std) == ({"n": 1.0, "C": 6.38e-4}[label], 0.0)
            else:
                assert abs(value - TRUTH[label]) < 4 * std


def test_errors_are_those_of_the_written_table(result: RecordEstimate) -> None:
    """Root mean squares by hand; the test block starts after the fit block, no row is in both."""
    for replay in result.replays:
        for e in replay.errors:
            rows = replay.table[replay.table["block"] == e.block]
            q = next(q for q in result.setup.model.outputs if q.name == e.output)
            measured = rows[f"{q.column}_measured"]
            for kind, value in (("predicted", e.one_step), ("free_run", e.free_run)):
                off = (measured - rows[f"{q.column}_{kind}"]).dropna()
                assert value == pytest.approx(float(np.sqrt((off**2).mean())))
            assert e.samples == measured.notna().sum() and e.unit == q.unit
        assert replay.table["time_s"].tolist() == list(range(240))
        assert (replay.table["block"] == "fit").sum() == CUT
        assert sum(replay.status_counts.values()) == 239


def test_free_run_is_one_simulation_with_the_parameters_of_the_end_of_the_fit_block(
    model: Model, plant: PlantRecord, result: RecordEstimate
) -> None:
    """Through both blocks, from the fitted initial state; no measurement of the test block is in it."""
    for replay in result.replays:
        values = np.array([v for v, _ in replay.parameters.values()])
        p = full_parameters(model, list(replay.parameters), values)
        x0 = result.batch.initial_state
        expected = RecordSimulator(model, 1.0).outputs(plant.dataset, x0, p)[:, model.index("outputs", "level")]
        np.testing.assert_allclose(replay.table["level_m_free_run"], expected, rtol=1e-9)


def test_the_test_block_is_never_used_for_the_fit(model: Model, plant: PlantRecord, result: RecordEstimate) -> None:
    """Other measurements in the test block: the same fit, and the same parameters at the end of the fit block."""
    blocks = plant.blocks(CUT)
    outputs = blocks.test.outputs.copy()
    outputs[1:] *= 1.05
    changed = estimate_record(replace(blocks, test=replace(blocks.test, outputs=outputs)), model)
    np.testing.assert_array_equal(changed.batch.values(), result.batch.values())
    np.testing.assert_array_equal(changed.batch.initial_state, result.batch.initial_state)
    for a, b in zip(changed.replays, result.replays, strict=True):
        assert a.parameters == b.parameters
        columns = [c for c in a.table.columns if c.endswith("_free_run") or c.endswith("_s")]
        pd.testing.assert_frame_equal(a.table[columns], b.table[columns])
        assert a.errors != b.errors


def test_the_last_row_of_the_fit_block_starts_the_test_block(plant: PlantRecord, model: Model, tmp_path: Path) -> None:
    """Its input row counts from the next on; read from a file, the cut is at the share asked for."""
    file = tmp_path / "plant.csv"
    plant.table.to_csv(file, index=False)
    blocks = read_blocks(file, model, 0.6)
    assert blocks.continues and len(blocks.fit) == 144 and len(blocks.test) == 97
    assert blocks.fit.time[-1] == blocks.test.time[0] == 143.0
    np.testing.assert_allclose(blocks.test.outputs, plant.dataset.outputs[143:], rtol=1e-12)


@pytest.mark.parametrize("share", [0.05, 0.95])
def test_a_record_too_short_for_two_blocks_is_an_error(
    plant: PlantRecord, model: Model, tmp_path: Path, share: float
) -> None:
    file = tmp_path / "plant.csv"
    plant.table.iloc[:12].to_csv(file, index=False)
    with pytest.raises(DataError, match=r"plant.csv: 12 rows can not be cut at 0\.[09]5"):
        read_blocks(file, model, share)


def test_a_second_experiment_as_test_block_starts_at_the_fitted_initial_state(model: Model, plant: PlantRecord) -> None:
    """`continues=False`: both blocks start at the same state, as the cascaded-tanks benchmark has it."""
    fit = plant.dataset.rows(0, CUT)
    found = errors(estimate_record(Blocks("twice", fit, fit, continues=False), model, estimators=["pem"]))
    for output in NOISE:
        a, b = found["pem", "fit", output], found["pem", "test", output]
        assert replace(a, block="test") == b


def test_driving_outputs_can_be_chosen(model: Model, plant: PlantRecord) -> None:
    """Fitted to the level alone, n and C are not identified, and the verdict says so."""
    found = estimate_record(plant.blocks(CUT), model, estimators=["pem"], outputs=["level"])
    assert found.setup.outputs == ("level",) and len(found.batch.noise_std) == 1
    assert "does not identify" in found.batch.identifiability.verdict


def test_parameters_can_be_chosen_by_name_symbol_and_group(model: Model, plant: PlantRecord) -> None:
    found = estimate_record(plant.blocks(CUT), model, estimators=["pem"], fit=["n", "floatability"])
    names = ("growth_exponent", "floatability.chalcopyrite", "floatability.quartz")
    assert found.setup.parameters == names == tuple(e.name for e in found.batch.estimates)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"fit": ["growth"]}, ModelError, "growth_exponent"),
        ({"outputs": ["grade"]}, ModelError, "concentrate_grade"),
        ({"outputs": ["recovery"]}, DataError, "output 'recovery' is not measured"),
        ({"estimators": ["rpm"]}, PluginError, "did you mean 'rpem'"),
        ({"estimators": ["not_there:Mine"]}, PluginError, "no module 'not_there'"),
    ],
)
def test_wrong_names_are_one_line(
    model: Model, plant: PlantRecord, options: dict[str, Any], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says) as caught:
        estimate_record(plant.blocks(CUT), model, **options)
    assert "\n" not in str(caught.value)


def test_a_record_without_any_measurement_is_a_data_error(model: Model, plant: PlantRecord) -> None:
    blocks = plant.blocks(CUT)
    blank = replace(blocks.fit, outputs=np.full_like(blocks.fit.outputs, np.nan))
    with pytest.raises(DataError, match="not measured"):
        estimate_record(replace(blocks, fit=blank), model)


def test_summary_is_strict_json_with_the_fit_and_every_error(result: RecordEstimate) -> None:
    def reject(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    text = json.dumps(plain(estimate_summary(Path("folder/plant.csv"), result)), allow_nan=False)
    summary = json.loads(text, parse_constant=reject)
    assert list(summary) == ["data", "model", "fit", "estimators", "innovations_form"]
    assert summary["data"] == "plant.csv" and summary["model"] == "flotation"
    fit = summary["fit"]
    assert [p["label"] for p in fit["parameters"]] == ["n", "C"]
    assert [p["value"] for p in fit["parameters"]] == result.batch.values().tolist()
    assert fit["covariance"] == result.batch.covariance.tolist()
    assert list(fit["noise_std"]) == list(NOISE) and fit["status"] == "ok"
    assert fit["identifiability"]["verdict"] == result.batch.identifiability.verdict
    assert [e["estimator"] for e in summary["estimators"]] == list(OF_A_RECORD)
    for entry in summary["estimators"]:
        assert {(e["block"], e["output"]) for e in entry["errors"]} == {(b, o) for b in ("fit", "test") for o in NOISE}


def test_a_fit_that_fails_is_summarised_without_nan(model: Model, plant: PlantRecord) -> None:
    """Feed that overfills the cell in the fit block: every estimator goes on, the summary says null."""
    blocks = plant.blocks(CUT)
    inputs = blocks.fit.inputs.copy()
    inputs[20:, 2] = 5e-4
    broken = replace(blocks, fit=replace(blocks.fit, inputs=inputs))
    found = estimate_record(broken, model)
    summary = plain(estimate_summary(Path("plant.csv"), found))
    json.dumps(summary, allow_nan=False)
    assert summary["fit"]["status"] == "not_finite"
    assert "can not simulate" in summary["fit"]["identifiability"]["verdict"]


def test_a_model_that_explodes_is_told_so_on_a_page() -> None:
    """Steps that are six times the time constant: free runs end beyond all numbers, and no estimator begins."""

    def equations(m: Scope) -> None:
        m.derivative("x", m.parameter("rate") * (m.input("u") - m.state("x")))
        m.output("x", m.state("x"))

    x, u = Quantity("x", "m", ""), Quantity("u", "m", "")
    rate = Parameter("rate", 0.3, "1/s", "a guess", lower=0.25, upper=0.35, scale=0.01, role="estimated")
    stiff = Model("stiff", (x,), (u,), (rate,), (x,), equations, max_step_s=20.0)
    time = 20.0 * np.arange(400.0)
    table = pd.DataFrame({"time_s": time, "u_m": np.sign(np.sin(time / 300.0)), "x_m": np.sin(time / 300.0)})
    found = estimate_record(read_blocks(table, stiff, 0.7), stiff)
    assert found.batch.status is Status.NOT_FINITE
    assert title(found) == "The model can not simulate the record from its first guess"
    page = estimate_report(found)
    assert (
        title(found) in page and NOTHING_FITTED.split(".")[0] in page and "± nan" not in page.partition("<section")[0]
    )


def test_replays_are_written_by_estimator(result: RecordEstimate, tmp_path: Path) -> None:
    write_replays(result, tmp_path)
    assert sorted(f.name for f in tmp_path.iterdir()) == sorted(f"{name}.csv" for name in OF_A_RECORD)
    back = pd.read_csv(tmp_path / "adaptive_imm.csv")
    assert list(back.columns) == list(result.replays[1].table.columns) and len(back) == 240


def test_the_fitted_cell_is_the_model_of_the_fit(result: RecordEstimate, tmp_path: Path) -> None:
    file = tmp_path / "fitted.yaml"
    save_fitted_cell(result, cell_file(), file)
    fitted = make_cell(read_cell(file))
    np.testing.assert_allclose(fitted.parameter_values, result.batch.parameters, rtol=1e-12)
    changed = [p for p in fitted.parameters if "calibrated on plant" in p.source]
    assert [p.label for p in changed] == ["n", "C"]


def test_tanks_of_the_public_benchmark_are_fitted(shared_file: Any) -> None:
    """Published: the plain model of the tanks leaves about 0.2 to 0.8 V on the validation record."""
    model = make_model("cascaded-tanks")
    file = shared_file("data/cascaded-tanks/dataBenchmark.csv")
    found = errors(estimate_record(read_blocks(file, model, 0.6), model, estimators=["pem", "fixed"]))
    assert found["pem", "test", "level"].free_run < 0.9 < found["fixed", "test", "level"].free_run


def test_the_rows_of_both_blocks_add_up(model: Model, plant: PlantRecord, result: RecordEstimate) -> None:
    """The test block begins at the last row of the fit block: that row is not counted twice."""
    rows = len(plant.blocks(CUT).fit) + plant.blocks(CUT).tested
    assert rows == len(result.replays[0].table)
    assert f"{CUT} rows to fit on, {rows - CUT} to test on" in estimate_report(result)


def test_the_title_says_first_that_a_fit_is_not_to_be_used(result: RecordEstimate) -> None:
    assert "predict" in title(result)
    judged = (("n", 0.9, "not identified"), ("C", 0.01, "on a bound"))
    unsure = replace(result, batch=replace(result.batch, identifiability=Identifiability(judged, (), "")))
    assert title(unsure) == "The record does not identify n; C ends on a bound"


def test_the_title_says_first_that_a_fit_is_worse_than_a_constant(result: RecordEstimate) -> None:
    """An error of a hundred times the noise, in every replay."""
    off = [tuple(replace(e, free_run=100 * e.free_run + 1e-3) for e in r.errors) for r in result.replays]
    bad = replace(result, replays=tuple(replace(r, errors=e) for r, e in zip(result.replays, off, strict=True)))
    assert title(bad).startswith("The fit of concentrate grade") and "is worse than a constant" in title(bad)


def test_stages_are_told_before_they_begin(model: Model, plant: PlantRecord) -> None:
    told: list[str] = []
    estimate_record(plant.blocks(CUT), model, estimators=["fixed"], innovations=False, progress=told.append)
    assert told == ["batch fit", "replay through fixed"]
