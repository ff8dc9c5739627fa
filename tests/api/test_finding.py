"""`af.discover`: a model and a table in; the verdict, the extended model and its figures out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import adaptive_flot as af
from adaptive_flot.api.finding import Finding
from adaptive_flot.errors import ModelError, OutputError, ResultError
from tests.discovery.heated import EXPONENT, Truth, heated_tank, tank_record

ROOT = Path(__file__).parents[2]


def tank_table(rows: int, truth: Truth | None = None) -> pd.DataFrame:
    """The record of the tank as a notebook would have it."""
    record = tank_record(truth, rows)
    columns = {"time_s": record.time, "power_W": record.inputs[:, 0], "fan_speed_1_s": record.inputs[:, 1]}
    return pd.DataFrame({**columns, "temperature_K": record.outputs[:, 0]})


@pytest.fixture(scope="module")
def finding() -> Finding:
    """The tank that loses more heat when the fan blows, given as an object and a table."""
    return af.discover(heated_tank(), tank_table(600), processes=1)


@pytest.fixture(scope="module")
def refused() -> Finding:
    """A record whose inputs never move: nothing is searched."""
    return af.discover(heated_tank(), tank_table(60).assign(power_W=1000.0, fan_speed_1_s=10.0), processes=1)


def test_the_effect_of_the_tank_is_named_and_its_exponent_in_the_table(finding: Finding) -> None:
    assert finding.verdict.word == "named"
    exponent = finding.effects.set_index("coefficient").loc["exponent"].to_dict()
    assert (exponent["site"], exponent["driver"]) == ("heat_loss", "fan_speed")
    assert exponent["low"] < exponent["value"] < exponent["high"]
    assert exponent["value"] == pytest.approx(EXPONENT, abs=0.03)
    (error,) = finding.table.to_dict("records")
    assert error["after"] < 0.5 * error["before"]


def test_the_finding_shows_and_plots_itself(finding: Finding, tmp_path: Path) -> None:
    for shown in (repr(finding), finding._repr_html_()):
        assert "named" in shown
        assert "temperature" in shown
        assert len(shown) < 3000
    assert finding.kinds == ("effect", "residual", "map")
    assert all(isinstance(finding.plot(kind), Figure) for kind in finding.kinds)
    assert len(finding.plot().axes) == len(finding.plot("effect").axes) == 2
    with pytest.raises(ResultError, match="did you mean 'residual'"):
        finding.plot("residuals")
    assert "heat loss by fan speed" in finding.report(tmp_path / "page.html").read_text()


def test_the_extended_model_is_saved_and_simulates_to_the_bit(
    finding: Finding, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(ModelError, match="base='my_file:make_model'"):
        finding.save(tmp_path / "extended.yaml")
    with pytest.raises(OutputError, match="is a folder"):
        finding.save(tmp_path, base="tests/discovery/heated:heated_tank")
    path = finding.save(tmp_path / "extended.yaml", base="tests/discovery/heated:heated_tank")
    inputs = tank_table(50).drop(columns="temperature_K")
    before, after = (af.simulate(model, inputs).table["temperature_K"] for model in (finding.model, path))
    np.testing.assert_array_equal(before, after)


def test_where_nothing_was_searched_there_is_nothing_to_draw_or_save(refused: Finding, tmp_path: Path) -> None:
    assert refused.verdict.word == "insufficient"
    assert refused.kinds == ()
    assert refused.table.empty
    assert refused.effects.empty
    assert "insufficient" in repr(refused)
    with pytest.raises(ResultError, match="nothing was searched"):
        refused.plot()
    with pytest.raises(ResultError, match="nothing was fitted"):
        refused.save(tmp_path / "x.yaml", base="flotation")
    assert not list(tmp_path.iterdir())
    assert "insufficient" in refused._repr_html_()
