"""Cell files: every number with its unit and source, every fault named in one line, the round trip of `save_cell`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import CellError
from adaptive_flot.processes.flotation import default_cell, make_model, read_cell, save_cell
from adaptive_flot.resources import cell_file

WriteCell = Callable[[Mapping[str, object]], Path]
CONTENT: dict[str, dict[str, Any]] = yaml.safe_load(cell_file().read_text())
ENTRIES = [f"{section}.{key}" for section, given in CONTENT.items() for key in given if key != "names"]
NEEDED = [entry for entry in ENTRIES if entry != "operation.air_flow_valid"]


def refused(file: Path) -> str:
    """The message of a cell file that is refused: one line that starts with the file."""
    with pytest.raises(CellError) as error:
        read_cell(file)
    message = str(error.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


# -- what is read ------------------------------------------------------------------------------------------------------


def test_every_number_of_the_file_reaches_the_model() -> None:
    """Value, unit and source of each entry, one parameter a mineral or bubble class."""
    cell = default_cell()
    parameters = {p.name: p for p in cell.parameters}
    seen = set()
    for section in ("cell", "pulp", "bubbles", "froth", "minerals", "level_loop"):
        for key, entry in CONTENT[section].items():
            if key == "names":
                continue
            stem = next(
                s for s in (key, f"bubble_{key}", f"mineral_{key}") if s in {n.split(".")[0] for n in parameters}
            )
            values = entry["value"] if isinstance(entry["value"], list) else [entry["value"]]
            group = [p for name, p in parameters.items() if name.split(".")[0] == stem]
            assert [p.value for p in group] == values, key
            assert {(p.unit, p.source) for p in group} == {(entry["unit"], entry["source"])}
            seen |= {p.name for p in group}
    assert seen == set(parameters)
    assert cell.minerals == tuple(CONTENT["minerals"]["names"])
    assert cell.bubble_classes == 5
    assert cell.operation["level_limits"] == (0.33, 0.42)


def test_shipped_cell_has_the_numbers_of_the_specification(shared_file: Callable[[str], Path]) -> None:
    """Each value and unit of the shared cell file; what ours has beyond it is our own."""
    specified = yaml.safe_load(shared_file("model/cell_87l.yaml").read_text())
    for section, entries in specified.items():
        for key, entry in entries.items():
            ours = CONTENT[section][key]
            assert ours == entry if key == "names" else (ours["value"], ours["unit"]) == (entry["value"], entry["unit"])


def test_value_answers_to_name_and_symbol() -> None:
    cell = default_cell()
    assert cell.value("growth_exponent") == cell.value("n") == 1.0
    assert cell.value("floatability.quartz") == 3e-6


def test_air_range_is_that_of_a_positive_bursting_rate(write_cell: WriteCell) -> None:
    """Where the file does not give it, or gives less: v_b = a + b j_g >= 0, so j_g >= 6.06e-4 / 0.9182 m/s."""
    lowest = 0.18 * 6.06e-4 / 0.9182
    for changes in ({"operation.air_flow_valid": ...}, {"operation.air_flow_valid.value": [1e-6, 5.4e-3]}):
        low, high = read_cell(write_cell(changes)).operation["air_flow_valid"]
        assert low == pytest.approx(lowest, rel=1e-9)
        assert high == pytest.approx(5.4e-3, rel=1e-9)


# -- what is refused ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("entry", NEEDED)
def test_missing_entry_is_named_with_its_unit(write_cell: WriteCell, entry: str) -> None:
    section, key = entry.split(".")
    message = refused(write_cell({entry: ...}))
    assert message.startswith(f"{entry} is missing; add {{value: ..., unit: {CONTENT[section][key]['unit']}")


@pytest.mark.parametrize("entry", ENTRIES)
def test_wrong_unit_is_named_with_the_right_one(write_cell: WriteCell, entry: str) -> None:
    section, key = entry.split(".")
    message = refused(write_cell({f"{entry}.unit": "furlong"}))
    assert message.startswith(f"{entry} is given in 'furlong'; convert the value and write unit: ")
    assert message.endswith(CONTENT[section][key]["unit"])


@pytest.mark.parametrize("entry", ENTRIES)
def test_value_that_is_not_a_finite_number_is_named(write_cell: WriteCell, entry: str) -> None:
    section, key = entry.split(".")
    value = CONTENT[section][key]["value"]
    for wrong in ("much", float("nan")):
        assert entry in refused(
            write_cell({f"{entry}.value": [wrong, *value[1:]] if isinstance(value, list) else wrong})
        )


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"cell.height": 0.48}, ("cell.height = 0.48 has no unit; write {value: 0.48, unit: m, source",)),
        ({"cell.height.unit": ...}, ("cell.height has no unit; write", "unit: m")),
        ({"cell.height.value": ...}, ("cell.height has no value; write",)),
        ({"cell.height.source": ...}, ("cell.height has no source; write",)),
        ({"cell.height.units": "m"}, ("cell.height.units: Extra inputs are not permitted",)),
        ({"cell.height.role": "guessed"}, ("cell.height.role: Input should be 'fixed' or 'estimated'", "'guessed'")),
        ({"froth.grwth_exponent": 1}, ("section 'froth' has the unknown entry 'grwth_exponent'", "'growth_exponent'?")),
        ({"froht": {}}, ("has the unknown entry 'froht'; did you mean 'froth'?",)),
        ({"operation.feed_flwo": 1}, ("section 'operation' has the unknown entry 'feed_flwo'", "'feed_flow'?")),
        ({"pulp": ...}, ("section 'pulp' is missing; add it",)),
        ({"operation": ...}, ("section 'operation' is missing; add it",)),
        ({"minerals": ...}, ("section 'minerals' is missing; add it",)),
        ({"level_loop": [1, 2]}, ("section 'level_loop' is missing; add it",)),
        ({"froth.growth_exponent.value": 9.0}, ("froth.growth_exponent = 9 - is outside", "[0.3, 5] -; correct")),
        ({"froth.growth_exponent.bounds": [1.5, 2.0]}, ("froth.growth_exponent = 1 - is outside", "[1.5, 2]")),
        ({"pulp.solids_fraction.value": -0.1}, ("pulp.solids_fraction = -0.1 - is outside", "[0, 0.9]")),
        ({"cell.height.value": 0.0}, ("cell.height = 0 m is outside its physical range",)),
        ({"minerals.density.value": [4200.0, 2.65]}, ("minerals.density = 2.65 kg/m3 is outside", "or its unit")),
        ({"minerals.density.value": [4200.0]}, ("minerals.density has 1 values; give 2, one a mineral",)),
        ({"bubbles.number.value": [1, 2]}, ("bubbles.number has 2 values; give 5, one a bubble",)),
        ({"cell.height.value": [0.4, 0.5]}, ("cell.height has 2 values; give one",)),
        ({"minerals.names": ["one"]}, ("minerals.names", "at least two different names, the valuable one first")),
        ({"minerals.names": ["one", "one"]}, ("minerals.names", "at least two different names")),
        ({"minerals.names": ["one", 2]}, ("minerals.names", "at least two different names")),
        ({"minerals.names": ...}, ("minerals.names", "at least two different names")),
        ({"minerals.names": ["a", "b", "c"]}, ("minerals.floatability has 2 values; give 3, one a mineral",)),
        ({"operation.feed_flow.value": [1e-4, 2e-4]}, ("operation.feed_flow = [0.0001, 0.0002]; give",)),
        ({"operation.feed_flow.value": -1e-4}, ("operation.feed_flow = [-0.0001]; give positive",)),
        ({"operation.level_limits.value": [0.42, 0.33]}, ("operation.level_limits = [0.42, 0.33]", "lower one first")),
        ({"operation.level_limits.value": 0.42}, ("operation.level_limits = [0.42]; give",)),
        ({"operation.air_flow_limits.value": [9e-5, 2e-3]}, ("operation.air_flow_limits [9e-05, 0.002]", "bursting")),
        ({"operation.air_flow_limits.value": [9e-4, 7.8]}, ("operation.air_flow_limits [0.0009, 7.8] m3/s leave",)),
    ],
)  # fmt: skip
def test_fault_is_named_with_file_and_entry(
    write_cell: WriteCell, changes: Mapping[str, object], parts: tuple[str, ...]
) -> None:
    message = refused(write_cell(changes))
    assert message.startswith(parts[0])
    assert all(part in message for part in parts), message


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"", "holds no entries"),
        (b"- a\n- b\n", "holds no entries"),
        (b"cell: [1\nfroth: {", "not a YAML file"),
        (b"cell: \x00", "not a YAML file"),
        (bytes(range(256)), "not a YAML file"),
    ],
)
def test_file_that_is_no_cell_is_refused(tmp_path: Path, content: bytes, part: str) -> None:
    file = tmp_path / "cell.yaml"
    file.write_bytes(content)
    assert refused(file).startswith(part)


@pytest.mark.parametrize("name", ["none.yaml", "."])
def test_missing_file_is_refused(tmp_path: Path, name: str) -> None:
    assert refused(tmp_path / name).startswith("no such cell file; see scenarios/cells/")


# -- save_cell ---------------------------------------------------------------------------------------------------------

WITHIN = {
    "growth_exponent": (0.5, 3.0),
    "coalescence_rate": (1e-4, 1e-2),
    "cross_section_area": (0.1, 0.3),
    "floatability.quartz": (0.0, 1e-3),
    "feed_concentration.chalcopyrite": (0.0, 100.0),
    "bubble_diameter.3": (1e-4, 1e-2),
    "integral_time": (10.0, 1e3),
}
some_values = st.fixed_dictionaries({}, optional={n: st.floats(*r, allow_subnormal=False) for n, r in WITHIN.items()})


@given(values=some_values)
def test_saved_cell_reads_back_to_the_bit(tmp_path_factory: pytest.TempPathFactory, values: dict[str, float]) -> None:
    """New values with the note as their source; every other value, source and limit as it was."""
    file = tmp_path_factory.getbasetemp() / "saved.yaml"
    save_cell(cell_file(), values, "calibrated on a record", file)
    before, after = default_cell(), read_cell(file)
    assert [p.name for p in after.parameters] == [p.name for p in before.parameters]
    changed_stems = {name.split(".")[0] for name in values}
    for old, new in zip(before.parameters, after.parameters, strict=True):
        assert new.value == values.get(old.name, old.value)
        assert new.source == ("calibrated on a record" if old.name.split(".")[0] in changed_stems else old.source)
    assert after.minerals == before.minerals
    low = max(2e-4, after.value("A") * 6.06e-4 / 0.9182)
    assert after.operation == {**before.operation, "air_flow_valid": (low, 5.4e-3)}


def test_saving_over_the_source_is_allowed(write_cell: WriteCell) -> None:
    file = write_cell({})
    save_cell(file, {"growth_exponent": 1.25}, "again", file)
    assert read_cell(file).value("n") == 1.25


def test_saved_parameters_are_those_of_the_model(write_cell: WriteCell) -> None:
    """The way back from a calibration: the model's full names are the keys."""
    file = write_cell({})
    model = make_model()
    save_cell(cell_file(), dict(zip(model.names("parameters"), model.parameter_values, strict=True)), "all", file)
    np.testing.assert_array_equal(make_model(read_cell(file)).parameter_values, model.parameter_values)


# -- known faults ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes",
    [
        {"bubbles.diameter.value": []},
        {"bubbles.diameter.value": [], "bubbles.number.value": []},
        {"bubbles.number.value": [0, 0, 0, 0, 0]},
        {"minerals.floatability.prior_std": [1e-5, 1e-7, 1e-7]},
        {"operation.level_limits.value": [0.33, 0.9]},
        {"operation.feed_flow.value": float("inf")},
    ],
    ids=["no diameters", "no bubble classes", "no bubbles", "too many priors", "level above the cell", "endless feed"],
)
def test_cell_that_can_not_work_is_refused(write_cell: WriteCell, changes: Mapping[str, object]) -> None:
    refused(write_cell(changes))


def test_bursting_rate_that_falls_with_air_is_taken(write_cell: WriteCell) -> None:
    """v_b = 1e-4 + 0.5 j_g - 20 j_g^2 is positive up to j_g = 2.5 cm/s, twice the upper limit of air."""
    changes = {"froth.burst_a.value": 1e-4, "froth.burst_b.value": 0.5, "froth.burst_c.value": -20.0}
    read_cell(write_cell({**changes, "operation.air_flow_valid.value": [2e-4, 4e-3]}))


def test_number_of_values_message_makes_sense(write_cell: WriteCell) -> None:
    assert "None" not in refused(write_cell({"cell.height.value": [0.4, 0.5]}))


def test_single_bubble_class_given_as_a_number_is_saved(write_cell: WriteCell) -> None:
    source = write_cell({"bubbles.diameter.value": 6e-4, "bubbles.number.value": 1})
    save_cell(source, {"growth_exponent": 1.2}, "note", source)
    assert read_cell(source).value("n") == 1.2


def test_unknown_name_is_not_saved(write_cell: WriteCell) -> None:
    file = write_cell({})
    with pytest.raises(CellError):
        save_cell(file, {"growth_exponnent": 1.2}, "note", file)
