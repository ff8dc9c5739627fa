"""A model file goes wherever a model is named: estimate, simulate, and back to a file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.model_writer import save_model
from tests.cli.conftest import Call
from tests.runner.records import TRUTH, plant_record

EXPONENT = "bubble_size_by_air_flow.exponent"


@pytest.fixture
def record(model: Model, tmp_path: Path) -> pd.DataFrame:
    """`record.csv` of a cell whose bubbles grow with air, and `extended.yaml`, a model that could but does not."""
    growth = Effect("bubble_size", "air_flow", "power", {"exponent": 0.3}, {"reference": 1.5e-3})
    made = plant_record(model.with_effects([growth]), rows=200)
    made.table.to_csv(tmp_path / "record.csv", index=False)
    extended = model.with_parameters(TRUTH).with_effects(
        [Effect("bubble_size", "air_flow", "power", {}, growth.settings)]
    )
    save_model(extended, tmp_path / "extended.yaml")
    return made.truth


def test_a_coefficient_is_fitted_by_name_saved_and_simulated(call: Call, record: pd.DataFrame, tmp_path: Path) -> None:
    """The exponent of the plant comes back within its standard deviation, and the saved model is the plant."""
    fit = ["--model", "extended.yaml", "--fit", EXPONENT, "--estimator", "pem"]
    result = call("estimate", "record.csv", *fit, "--save-model", "fitted.yaml", "--out", "r")
    assert result.code == 0, result.err
    (found,) = json.loads((tmp_path / "r" / "summary.json").read_text())["fit"]["parameters"]
    assert found["name"] == EXPONENT and found["unit"] == "-"
    assert abs(found["value"] - 0.3) < 4 * found["std"] < 0.1
    saved = yaml.safe_load((tmp_path / "fitted.yaml").read_text())
    assert saved["effects"][0]["coefficients"]["exponent"] == found["value"]
    assert "record" in saved["note"]
    assert call("simulate", "record.csv", "--model", "fitted.yaml", "--out", "again.csv").code == 0
    grade = pd.read_csv(tmp_path / "again.csv")["concentrate_grade"]
    assert np.abs(grade - record["concentrate_grade"]).max() < 1e-3


def test_a_model_file_of_this_folder_goes_before_one_beside_the_data(call: Call, record: pd.DataFrame) -> None:
    """A name on the command line means a file here, as everywhere in a shell."""
    Path("data").mkdir()
    Path("record.csv").rename("data/record.csv")
    Path("data/extended.yaml").write_text("not: a model\n")
    simulated = call("simulate", "data/record.csv", "--model", "extended.yaml", "--out", "s.csv")
    assert simulated.code == 0, simulated.err
    Path("extended.yaml").unlink()
    result = call("simulate", "data/record.csv", "--model", "extended.yaml", "--out", "s.csv")
    assert result.code == 2 and "data/extended.yaml: " in result.err and len(result.err.splitlines()) == 1


def test_an_unknown_coefficient_names_the_near_one(call: Call, record: pd.DataFrame, tmp_path: Path) -> None:
    fit = ["--fit", EXPONENT.replace("exponent", "exponnt")]
    result = call("estimate", "record.csv", "--model", "extended.yaml", *fit, "--save-model", "f.yaml", "--out", "r")
    assert result.code == 2 and f"did you mean '{EXPONENT}'" in result.err
    assert not (tmp_path / "f.yaml").exists() and not (tmp_path / "r").exists()


TANK = """
import casadi
import numpy as np
from adaptive_flot.greybox import Model, Quantity, Scope

def equations(m: Scope) -> None:
    level, inflow = m.state("level"), m.input("inflow")
    {line}
    m.derivative("level", 0.1 * (used - level))
    m.output("level", level)

def make_model() -> Model:
    return Model("tank", (Quantity("level", "m", "state", 0, 10),), (Quantity("inflow", "-", "input", 0, 10),), (),
                 (Quantity("level", "m", "output", 0, 10),), equations, max_step_s=1.0)
"""


@pytest.mark.parametrize("line", ["used = np.maximum(inflow, 2.0)", "used = casadi.fmax(inflow, 2.0)"])
def test_numpy_on_a_quantity_works_without_a_page_of_warnings(call: Call, line: str, tmp_path: Path) -> None:
    (tmp_path / "tank.py").write_text(TANK.format(line=line))
    time = np.arange(200.0)
    pd.DataFrame({"time_s": time, "inflow": np.where(time < 100, 1.0, 3.0)}).to_csv("record.csv", index=False)
    result = call("simulate", "record.csv", "--model", "tank.py:make_model", "--out", "s.csv")
    assert result.code == 0 and "Warning" not in result.err, result.err
    level = pd.read_csv("s.csv")["level_m"]
    assert level[99] == pytest.approx(2.0, abs=1e-3) and level.iloc[-1] == pytest.approx(3.0, abs=1e-3)


def test_a_condition_on_a_quantity_says_what_to_write(call: Call, tmp_path: Path) -> None:
    (tmp_path / "tank.py").write_text(TANK.format(line="used = inflow if inflow > 2.0 else 2.0"))
    pd.DataFrame({"time_s": np.arange(200.0), "inflow": 1.0}).to_csv("record.csv", index=False)
    result = call("simulate", "record.csv", "--model", "tank.py:make_model", "--out", "s.csv")
    assert result.code == 2 and len(result.err.splitlines()) == 1
    assert "tank.py, line 8: " in result.err and "write casadi.if_else" in result.err
