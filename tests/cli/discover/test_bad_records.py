"""Bad data gets a word, never a name: each kind through the command, on a record of the heated tank."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.cli.conftest import Call
from tests.cli.discover.test_discover import write_tank

Change = Callable[[pd.DataFrame], pd.DataFrame]


def _pasted(t: pd.DataFrame) -> pd.DataFrame:
    columns = ["power_W", "fan_speed_1_s", "temperature_K"]
    t.loc[300:339, columns] = t.loc[20:59, columns].to_numpy()
    return t


def _jump(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(time_s=t["time_s"] - np.where(t.index >= 300, 900.0, 0.0))


def _hole(t: pd.DataFrame) -> pd.DataFrame:
    return t.drop(index=range(280, 300))


def _frozen(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(temperature_K=t["temperature_K"].where(~t.index.isin(range(100, 160)), t["temperature_K"][100]))


def _clipped(t: pd.DataFrame) -> pd.DataFrame:
    return t.assign(temperature_K=t["temperature_K"].clip(upper=float(t["temperature_K"].quantile(0.9))))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_pasted, "lines 302 to 341 repeat earlier rows"),
        (_jump, "the clock jumps back in line 302"),
        (_hole, "2 stretches"),
        (_frozen, "59 samples of a frozen sensor left out"),
        (_clipped, "clipped at the highest value left out"),
    ],
)
def test_estimate_says_what_it_left_out(call: Call, tmp_path: Path, change: Change, says: str) -> None:
    change(write_tank(tmp_path)).to_csv(tmp_path / "tank.csv", index=False)
    result = call("estimate", "tank.csv", "--model", "heated:make_model", "--estimator", "fixed")
    assert result.code == 0 and says in " ".join(result.out.split()), result.err


def test_discover_says_it_too_and_still_names_what_is_there(call: Call, tmp_path: Path) -> None:
    _pasted(write_tank(tmp_path)).to_csv(tmp_path / "tank.csv", index=False)
    result = call("discover", "tank.csv", "--model", "heated:make_model", "--processes", "1")
    assert result.code == 0 and result.out.startswith("named: ") and "fan_speed" in result.out
    page = (tmp_path / "results" / "tank" / "discover" / "report.html").read_text()
    for text in (" ".join(result.out.split()), page):
        assert "lines 302 to 341 repeat earlier rows" in text


@pytest.mark.parametrize("command", ["discover", "estimate"])
def test_a_record_without_an_output_is_refused_in_the_same_words(call: Call, tmp_path: Path, command: str) -> None:
    write_tank(tmp_path).drop(columns="temperature_K").to_csv(tmp_path / "tank.csv", index=False)
    result = call(command, "tank.csv", "--model", "heated:make_model", "--out", "r")
    assert result.code == 2 and len(result.err.splitlines()) == 1
    assert (
        "tank.csv: column 'temperature_K' is missing; add it (every column of the file has another use)" in result.err
    )
    assert not (tmp_path / "r").exists()


def test_an_output_whose_column_is_empty_is_a_verdict(call: Call, tmp_path: Path) -> None:
    write_tank(tmp_path).assign(temperature_K=np.nan).to_csv(tmp_path / "tank.csv", index=False)
    result = call("discover", "tank.csv", "--model", "heated:make_model", "--out", "r")
    assert result.code == 0 and "no output has a usable measurement" in " ".join(result.out.split())
