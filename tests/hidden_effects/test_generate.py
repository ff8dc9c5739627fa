"""Records: the same for a seed whatever their number, and of the format that is promised."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import DataError
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE
from benchmarks.hidden_effects.generate import schedule
from benchmarks.hidden_effects.generate.folder import answer_file, generate, record_file
from benchmarks.hidden_effects.generate.ground_truth import VERDICTS
from benchmarks.hidden_effects.generate.record import BIN, make_record


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two records: a single effect and one without."""
    folder = tmp_path_factory.mktemp("records")
    generate(folder, seed=27, count=2, jobs=1)
    return folder


def test_a_record_is_the_same_whatever_the_count(made: Path, tmp_path: Path) -> None:
    """Record 1 made alone, with nothing before it, is record 1 of two to the last digit."""
    alone = make_record(27, 1)
    assert alone.answer.as_dict() == json.loads(answer_file(made, "record_0001").read_text())
    read = pd.read_csv(record_file(made, "record_0001"))
    np.testing.assert_allclose(read.to_numpy(), alone.table.to_numpy(), rtol=1e-6)


def test_tables_have_the_columns_of_a_measured_record(made: Path) -> None:
    """Time, inputs and outputs by the names of the model page, a row a second, no missing value without a fault."""
    for name in ("record_0000", "record_0001"):
        table = pd.read_csv(record_file(made, name))
        assert list(table.columns) in (["time_s", *INPUTS, *OUTPUTS], ["time_s", *INPUTS, *OUTPUTS[:3]])
        assert np.array_equal(table["time_s"], np.arange(1.0, len(table) + 1.0))
        assert not table.isna().to_numpy().any()


def test_answers_say_what_is_hidden_and_what_there_is_to_gain(made: Path) -> None:
    """Where nothing is hidden the base is as good as the oracle; where something is, the base is worse."""
    single, none = (json.loads(answer_file(made, f"record_000{k}").read_text()) for k in (0, 1))
    assert (single["verdict"], none["verdict"]) == ("named", "none")
    assert single["verdict"] in VERDICTS
    assert single["site"] and single["driver"] and single["effects"][0]["site"] in single["site"]
    base, oracle = (none[key]["concentrate_grade"]["report"] for key in ("base_error", "oracle_error"))
    assert base == pytest.approx(oracle, rel=0.2)
    assert max(single["size"].values()) > 4.0
    errors = [single["base_error"][o]["report"] / single["oracle_error"][o]["report"] for o in single["base_error"]]
    assert max(errors) > 2.0


def test_squares_by_part_add_up_to_the_error_of_the_whole(made: Path) -> None:
    """The last fifth by its bins is the error on the last fifth, of base and oracle in each output."""
    answer = json.loads(answer_file(made, "record_0000").read_text())
    first = int(0.8 * answer["rows"]) // BIN
    for output, squares in answer["squares"].items():
        rows = sum(squares["rows"][first:])
        for key in ("base", "oracle"):
            found = np.sqrt(sum(squares[key][first:]) / rows)
            assert found == pytest.approx(answer[f"{key}_error"][output]["report"], rel=1e-4)


def test_a_folder_holds_one_seed(made: Path) -> None:
    """Records of two seeds are never mixed."""
    with pytest.raises(DataError, match=r"manifest.json: holds records of .*another folder"):
        generate(made, seed=4, count=2, jobs=1)


def test_the_schedule_covers_the_catalogue() -> None:
    """300 records: each category, and each kind of single effect at least twice."""
    assert set(Counter(schedule.category(k) for k in range(300))) == set(schedule.CATEGORIES)
    singles = Counter(schedule.single_entry(7, k) for k in range(300) if schedule.category(k) == "single")
    assert len(singles) == len(CATALOGUE) and min(singles.values()) >= 2
