"""What `discover` has found and saved is run again: the saved model has nothing left to find on the same record."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from adaptive_flot.greybox.data.dataset import Dataset
from tests.cli.conftest import Call
from tests.discovery import heated
from tests.discovery.candidates.test_pulses import with_a_pulse
from tests.discovery.candidates.test_relays import vented

MODEL = f"{heated.__file__}:heated_tank"


def write(record: Dataset, file: Path) -> None:
    columns = {"time_s": record.time, "power_W": record.inputs[:, 0], "fan_speed_1_s": record.inputs[:, 1]}
    pd.DataFrame({**columns, "temperature_K": record.outputs[:, 0]}).to_csv(file, index=False)


@pytest.mark.parametrize(
    ("record", "says"),
    [(with_a_pulse(), "Thermometer showed 0.6"), (vented(), "larger once fan speed has risen above")],
    ids=["pulse", "switch"],
)
def test_a_saved_model_runs_as_the_fitted_one_and_lacks_nothing(
    call: Call, tmp_path: Path, record: Dataset, says: str
) -> None:
    write(record, tmp_path / "new.csv")
    first = call("discover", "new.csv", "--model", MODEL, "--out", "r", "--save-model", "m.yaml", "--no-report")
    assert first.code == 0 and first.out.startswith("named: "), first.out + first.err
    assert says in " ".join(first.out.split())
    again = call("discover", "new.csv", "--model", "m.yaml", "--out", "r2", "--no-report")
    assert again.code == 0 and again.out.startswith("none: "), again.out + again.err
    left = json.loads((tmp_path / "r2" / "verdict.json").read_text())["error"]["temperature"]
    assert left["before"] < 1.25 * heated.NOISE, "the saved model is at the noise before anything is searched"
