"""A record whose stamps are not even: the message names a command, and that command makes a record of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from tests.cli.conftest import Call
from tests.cli.discover.test_discover import write_tank


def test_the_command_in_the_message_puts_a_record_on_a_grid(call: Call, tmp_path: Path) -> None:
    """Stamps that jitter by a hundredth of the interval; the state is called T, as a column of times may be."""
    table = write_tank(tmp_path)
    jitter = np.random.default_rng(1).integers(-1, 2, len(table))
    table.assign(time_s=table["time_s"] + 0.3 * jitter, T=1.0).to_csv(tmp_path / "tank.csv", index=False)
    refused = call("estimate", "tank.csv", "--model", "heated:make_model", "--estimator", "fixed")
    assert refused.code == 2
    named = re.search(r"'adaptive-flot (import tank.csv --out even.csv)', and the same --model", refused.err)
    assert named, refused.err
    imported = call(*named[1].split(), "--model", "heated:make_model", "--yes", "--no-report")
    assert imported.code == 0, imported.err
    assert call("estimate", "even.csv", "--model", "heated:make_model", "--estimator", "fixed").code == 0


def test_a_record_that_is_even_already_comes_back_as_it_was(call: Call, tmp_path: Path) -> None:
    """Its inputs acted up to their rows; taken for an export, they would act one row later."""
    table = write_tank(tmp_path)
    result = call("import", "tank.csv", "--out", "even.csv", "--model", "heated:make_model", "--yes", "--no-report")
    assert result.code == 0, result.err
    even = pd.read_csv(tmp_path / "even.csv")[list(table.columns)]
    pd.testing.assert_frame_equal(even, table, check_dtype=False, rtol=1e-9)


def test_several_columns_that_may_hold_times_are_a_question(call: Call, tmp_path: Path) -> None:
    table = write_tank(tmp_path).rename(columns={"time_s": "time"}).assign(T=1.0)
    table.to_csv(tmp_path / "tank.csv", index=False)
    result = call("import", "tank.csv", "--out", "even.csv", "--model", "heated:make_model", "--yes")
    assert result.code == 2 and "'time: {column: time}' or 'time: {column: T}'" in result.err
