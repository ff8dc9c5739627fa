"""`af.simulate` and `af.estimate`: tables in, tables out, and the fitted model as a file that is a model again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import adaptive_flot as af
from adaptive_flot.api.estimation import Estimation
from adaptive_flot.api.simulation import Simulation
from adaptive_flot.errors import CellError, ModelError, PluginError, ResultError
from adaptive_flot.processes.flotation import read_cell

TRUE_C = 7.5e-4


@pytest.fixture(scope="module")
def simulated() -> Simulation:
    """The laboratory cell with another coalescence rate, its feed moved up and down."""
    time = np.arange(0.0, 900.0, 5.0)
    feed = np.where(time % 300 < 150, 1.7e-4, 2.0e-4)
    columns = {"time_s": time, "air_flow_m3_s": 1.5e-3, "feed_flow_m3_s": feed, "level_setpoint_m": 0.4, "C": TRUE_C}
    return af.simulate("lab_87l", pd.DataFrame(columns))


@pytest.fixture(scope="module")
def record(simulated: Simulation) -> pd.DataFrame:
    """What the analyser would have shown."""
    noise = np.random.default_rng(1).normal(0.0, 1e-4, len(simulated.table))
    kept = ["time_s", "air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m", "concentrate_grade"]
    return simulated.table[kept].assign(concentrate_grade=lambda t: t["concentrate_grade"] + noise)


@pytest.fixture(scope="module")
def fit(record: pd.DataFrame) -> Estimation:
    """One parameter fitted."""
    return af.estimate("lab_87l", record, estimators=["fixed", "pem"], parameters=["C"])


def test_a_fit_of_a_table_finds_the_parameter_behind_it(fit: Estimation) -> None:
    (row,) = fit.parameters.to_dict("records")
    assert row["label"] == "C"
    assert row["value"] == pytest.approx(TRUE_C, abs=4 * row["std"])
    test = fit.table[fit.table["block"] == "test"].set_index("estimator")["one_step"]
    assert test["pem"] < 1.5e-4 < test["fixed"]


def test_a_saved_fit_is_a_model_again_and_a_cell_file_too(fit: Estimation, tmp_path: Path) -> None:
    value = fit.parameters["value"][0]
    inputs = pd.DataFrame({"time_s": [0.0, 5.0], **_steady()})
    own = af.simulate(fit.model, inputs).table["concentrate_grade"]
    for saved in (fit.save(tmp_path / "model.yaml"), fit.save_cell(tmp_path / "cell.yaml")):
        again = af.simulate(saved, inputs).table["concentrate_grade"]
        np.testing.assert_allclose(again, own, rtol=1e-12)
    assert {p.symbol: p.value for p in read_cell(tmp_path / "cell.yaml").parameters}["C"] == pytest.approx(value)


def test_results_show_plot_and_report_themselves(fit: Estimation, simulated: Simulation, tmp_path: Path) -> None:
    for result, word in ((fit, "pem"), (simulated, "concentrate_grade")):
        for shown in (repr(result), result._repr_html_()):
            assert word in shown
            assert len(shown) < 6000
    figures = [fit.plot(kind) for kind in ("outputs", "parameters", "inputs")]
    figures += [simulated.plot(), simulated.plot(["level", "concentrate_grade"])]
    assert all(isinstance(figure, Figure) for figure in figures)
    assert [len(simulated.plot(["level"]).axes), len(simulated.plot(["level", "recovery"]).axes)] == [1, 2]
    assert "pem" in fit.report(tmp_path / "page.html").read_text()
    assert len(pd.read_csv(simulated.save(tmp_path / "table.csv"))) == len(simulated.table)


def test_a_simulation_is_drawn_over_what_was_measured(simulated: Simulation, record: pd.DataFrame) -> None:
    again = af.simulate(simulated.model, record.assign(**{"level_m": np.nan}))
    (axes,) = again.plot(["concentrate_grade"]).axes
    drawn = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.lines}
    np.testing.assert_array_equal(drawn["measured"], record["concentrate_grade"])
    np.testing.assert_array_equal(drawn["simulated"], again.table["concentrate_grade"])


def test_a_record_at_hand_gives_what_its_table_gives(record: pd.DataFrame, fit: Estimation) -> None:
    model = fit.result.setup.model
    again = af.estimate(model, af.read_dataset(record, model), estimators=["fixed", "pem"], parameters=["C"])
    pd.testing.assert_frame_equal(again.table, fit.table)


def test_wrong_things_are_one_line(record: pd.DataFrame, fit: Estimation, tmp_path: Path) -> None:
    with pytest.raises(PluginError, match="unknown model 'lab_88l'"):
        af.simulate("lab_88l", record)
    with pytest.raises(CellError, match=r"nothing\.yaml"):
        af.simulate(_written(tmp_path / "nothing.yaml", "cell: {}\n"), record)
    with pytest.raises(PluginError, match="unknown estimator 'rpm'; did you mean 'rpem'"):
        af.estimate("lab_87l", record, estimators="rpm")
    with pytest.raises(ModelError, match="fit_share = 60; give a number between 0 and 1"):
        af.estimate("lab_87l", record, fit_share=60)
    with pytest.raises(ResultError, match="no kind 'output' here; did you mean 'outputs'"):
        fit.plot("output")


def test_a_model_given_as_an_object_can_be_saved_where_its_maker_is_named(tmp_path: Path) -> None:
    """A file can not hold an object: the message says what to give, and with it the file works."""
    model = af.Model(
        name="mine",
        states=(af.Quantity("x", "V", ""),),
        inputs=(af.Quantity("u", "V", ""),),
        parameters=(af.Parameter("rate", 0.3, "1/s", "", lower=0.01, upper=5.0, scale=0.3, role="estimated"),),
        outputs=(af.Quantity("y", "V", ""),),
        equations=_first_order,
    )
    table = pd.DataFrame({"time_s": np.arange(60.0), "u_V": np.arange(60) // 10 % 2})
    made = af.simulate(model.with_parameters({"rate": 0.5}), table).table
    fit = af.estimate(model, made, estimators="fixed")
    assert fit.parameters["value"][0] == pytest.approx(0.5, rel=1e-3)
    with pytest.raises(ModelError, match="base='my_file:make_model'"):
        fit.save(tmp_path / "x.yaml")
    with pytest.raises(ModelError, match="has no cell file; use save"):
        fit.save_cell(tmp_path / "x.yaml")
    assert not list(tmp_path.iterdir())


def _first_order(m: af.Scope) -> None:
    m.derivative("x", m.parameter("rate") * (m.input("u") - m.state("x")))
    m.output("y", m.state("x"))


def _steady() -> dict[str, float]:
    return {"air_flow_m3_s": 1.5e-3, "feed_flow_m3_s": 1.7e-4, "level_setpoint_m": 0.4}


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path
