"""Model files: what is saved and read again is the same model to the bit; what is wrong in one is named in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import AdaptiveFlotError, ModelError, OutputError
from adaptive_flot.greybox import Stepper, steady_state
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.processes.registry import make_model
from adaptive_flot.resources import cell_file
from tests.edits import edit

EFFECTS = (
    Effect("bubble_size", "air_flow", "power", {"exponent": 0.25, "amplitude": 1 / 30}, {"reference": 1.5e-3}),
    Effect("coalescence", "time", "ramp", {"amplitude": 0.1, "onset": 20.0, "duration": 40.0}),
    Effect("burst_rate", "level", "curve", {"value_2": -0.01}, {"knots": (0.33, 0.36, 0.39, 0.42)}),
    Effect("feed_flow", "delay", "delay", {"amplitude": 1.0, "dead_time": 24.0}, {"scale": 1.67e-4, "stages": 3}),
    Effect("concentrate_flow", "lag", "lag", {"amplitude": 0.7, "time_constant": 12.0}, {"scale": 1e-6}),
    Effect("grade_sensor", "constant", "shift", {"amplitude": 0.01}),
    Effect("level_sensor", "air_flow", "linear", {"slope": 0.002}, {"reference": 1.5e-3}, "factor"),
)
CONTENT = """
model: flotation
cell: lab_87l
parameters:
  n: {value: 1.1, unit: "-", source: calibrated}
effects:
  - site: bubble_size
    driver: air_flow
    form: power
    coefficients: {exponent: 0.25}
    settings: {reference: {value: 1.5e-3, unit: m3/s}}
"""
REFERENCE = "effects.0.settings.reference"


def trajectory(model: Model) -> np.ndarray:
    u = np.tile([1.5e-3, 1.67e-4, 0.38], (60, 1))
    u[20:, 0], u[40:, 1] = 1.8e-3, 1.8e-4
    run = Stepper(model, 1.0).simulate(steady_state(model, u[0]).state, u)
    return np.hstack([run.states, run.outputs, run.signals])


def test_a_saved_model_has_the_same_trajectories_to_the_bit(model: Model, tmp_path: Path) -> None:
    """Factor and offset, curve, ramp in time, delay and lag with states, awkward numbers, changed parameters."""
    extended = model.with_parameters({"n": 1 / 3 + 0.7, "C": 6.1234567890123e-4}).with_effects(EFFECTS)
    save_model(extended, tmp_path / "extended.yaml", note="found on record.csv")
    again = make_model("extended.yaml", folder=tmp_path)
    assert again.effects == extended.fitted_effects()
    np.testing.assert_array_equal(trajectory(again), trajectory(extended))
    assert again.parameters[again.index("parameters", "n")].source == "found on record.csv"


@given(
    exponent=st.floats(-10, 10), reference=st.floats(1e-12, 1e12), onset=st.floats(-1e300, 1e300), rate=st.floats(0, 1)
)
def test_every_number_survives(
    tmp_path_factory: pytest.TempPathFactory, exponent: float, reference: float, onset: float, rate: float
) -> None:
    file = tmp_path_factory.mktemp("model") / "m.yaml"
    effects = (
        Effect("lower_inflow", "upper_level", "power", {"exponent": exponent}, {"reference": reference}),
        Effect("pump_flow", "time", "step", {"onset": onset}),
    )
    extended = make_model("cascaded-tanks").with_parameters({"k1": rate}).with_effects(effects)
    save_model(extended, file, base="cascaded-tanks")
    again = make_model(str(file))
    np.testing.assert_array_equal(again.parameter_values, extended.parameter_values)
    assert [e.full_settings for e in again.effects] == [e.full_settings for e in extended.effects]


def test_a_model_file_is_a_base_too(model: Model, tmp_path: Path) -> None:
    """Discovery on an extended model: what is saved names the process, with all effects, old and new."""
    save_model(model.with_parameters({"n": 1.1}).with_effects(EFFECTS[:1]), tmp_path / "first.yaml", note="first")
    first = make_model("first.yaml", folder=tmp_path)
    (tmp_path / "sub").mkdir()
    second = first.with_parameters({"C": 6e-4}).with_effects(EFFECTS[1:2])
    save_model(second, tmp_path / "sub" / "second.yaml", base="first.yaml", folder=tmp_path, note="second")
    content = yaml.safe_load((tmp_path / "sub" / "second.yaml").read_text())
    assert (content["model"], content["cell"]) == ("flotation", "lab_87l")
    assert [p["source"] for p in content["parameters"].values()] == ["first", "second"]
    again = make_model("second.yaml", folder=tmp_path / "sub")
    assert again.effects == second.fitted_effects()
    np.testing.assert_array_equal(again.parameter_values, second.parameter_values)


def test_paths_are_relative_to_the_model_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell or an own model in another folder is found from wherever the command is given."""
    (tmp_path / "own").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "own" / "cell.yaml").write_text(cell_file().read_text().replace("6.38e-4", "6.00e-4"))
    (tmp_path / "own" / "model_file_tanks.py").write_text(
        "from adaptive_flot.processes.cascaded_tanks import make_model\n"
    )
    cell = make_model(cell="cell.yaml", folder=tmp_path / "own")
    save_model(cell.with_effects(EFFECTS[:1]), tmp_path / "a.yaml", cell="cell.yaml", folder=tmp_path / "own")
    address = "model_file_tanks:make_model"
    tanks = make_model(address, folder=tmp_path / "own")
    spill = Effect("lower_inflow", "upper_level", "overflow", {"slope": 0.0, "gain": 0.1, "threshold": 9.0})
    save_model(tanks.with_effects([spill]), tmp_path / "b.yaml", base=address, folder=tmp_path / "own")
    monkeypatch.chdir(tmp_path / "elsewhere")
    again = make_model("../a.yaml")
    assert again.parameter_values[again.index("parameters", "C")] == 6e-4
    assert make_model(str(tmp_path / "b.yaml")).effects[0] == spill


def test_a_model_that_can_not_be_saved_leaves_the_file_as_it_was(model: Model, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(CONTENT)
    with pytest.raises(ModelError, match="is not 'cascaded-tanks' with effects"):
        save_model(model, file, base="cascaded-tanks")
    with pytest.raises(ModelError, match=r"ends in \.yaml"):
        save_model(model, tmp_path / "m.csv")
    with pytest.raises(OutputError):
        save_model(model, file / "below.yaml")
    assert file.read_text() == CONTENT and list(tmp_path.iterdir()) == [file]


def test_a_unit_that_nobody_knows_is_not_asked_for(tmp_path: Path) -> None:
    """A user's own model need not give the units of its sites; its drivers have theirs."""
    (tmp_path / "unitless.py").write_text(
        "from adaptive_flot.greybox import Model, Parameter, Quantity\n"
        "def equations(m):\n"
        "    m.derivative('x', m.input('u') - m.site('outflow', m.parameter('k') * m.state('x')))\n"
        "    m.output('y', m.state('x'))\n"
        "def make_model():\n"
        "    q = lambda n, unit: (Quantity(n, unit, ''),)\n"
        "    return Model('mine', q('x', 'kg'), q('u', 'kg/s'), (Parameter('k', 0.1, '1/s', ''),), q('y', 'kg'),"
        " equations)\n"
    )
    own = make_model("unitless:make_model", folder=tmp_path)
    spill = Effect("outflow", "x", "overflow", {"slope": 0.1, "gain": 0.5, "threshold": 2.0})
    save_model(own.with_effects([spill]), tmp_path / "m.yaml", base="unitless:make_model", folder=tmp_path)
    (entry,) = yaml.safe_load((tmp_path / "m.yaml").read_text())["effects"]
    assert entry["coefficients"] == {
        "slope": 0.1,
        "gain": 0.5,
        "threshold": {"value": 2.0, "unit": "kg"},
    }
    assert make_model("m.yaml", folder=tmp_path).effects[0].coefficients == spill.coefficients


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"modl": "flotation"}, "unknown key 'modl'; did you mean 'model'"),
        ({"model": ...}, "key 'model' is missing"),
        ({"model": "flotatoin"}, "did you mean 'flotation'"),
        ({"model": "other.yaml"}, "is a model file itself"),
        ({"model": "cascaded-tanks"}, "takes no cell file"),
        ({"cell": "lab_78l"}, "did you mean 'lab_87l'"),
        ({"parameters.n.unit": "m"}, "parameters.n: given in 'm'; convert the value and write unit: -"),
        ({"parameters.n.value": 50.0}, "outside its physical range"),
        ({"parameters": {"nn": {"value": 1.0, "unit": "-", "source": "x"}}}, "no 'nn' among its parameters"),
        ({"parameters.n.source": ...}, "key 'parameters.n.source' is missing"),
        ({"effects.0.sit": "bubble_size"}, "unknown key 'effects.0.sit'; did you mean 'site'"),
        ({"effects.0.site": "bubble_siz"}, "did you mean 'bubble_size'"),
        ({"effects.0.driver": "air_flo"}, "did you mean 'air_flow'"),
        ({"effects.0.form": "powr"}, "did you mean 'power'"),
        ({"effects.0.mode": "product"}, "effects.0.mode"),
        ({"effects.0.coefficients": {"exponnt": 0.2}}, "did you mean 'exponent'"),
        ({"effects.0.coefficients.exponent": "much"}, "effects.0.coefficients.exponent.value: Input should be a valid"),
        ({"effects.0.coefficients.exponent": 11.0}, "outside"),
        ({REFERENCE: 1.5e-3}, "settings.reference: 0.0015 has no unit; write {value: 0.0015, unit: m3/s}"),
        ({f"{REFERENCE}.unit": "l/s"}, "settings.reference: given in 'l/s'; convert the value and write unit: m3/s"),
        ({f"{REFERENCE}.value": -1.0}, "give one positive number"),
        ({f"{REFERENCE}.unti": "m3/s"}, "did you mean 'unit'"),
    ],
)
def test_what_is_wrong_is_one_line_with_file_place_and_remedy(
    tmp_path: Path, changes: dict[str, Any], says: str
) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(yaml.safe_dump(edit(yaml.safe_load(CONTENT), changes)))
    with pytest.raises(AdaptiveFlotError) as error:
        make_model("m.yaml", folder=tmp_path)
    message = str(error.value)
    assert message.startswith(str(file)) and says in message and "\n" not in message


@pytest.mark.parametrize("text", ["", "[1, 2]", "model: [", "\x00"])
def test_a_file_that_holds_no_model_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(text)
    with pytest.raises(ModelError, match=r"m\.yaml: .*(not a YAML file|holds no keys)"):
        make_model(str(file))
    with pytest.raises(ModelError, match="no such model file"):
        make_model("other.yaml", folder=tmp_path)


def test_a_cell_beside_a_model_file_is_refused(tmp_path: Path) -> None:
    """The model file names its cell: two of them would be one too many."""
    (tmp_path / "m.yaml").write_text(CONTENT)
    with pytest.raises(AdaptiveFlotError, match="names its cell itself"):
        make_model("m.yaml", cell="lab_87l", folder=tmp_path)
