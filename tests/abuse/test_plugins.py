"""A user's plug-in that raises, exits or returns something else: one line with its file and line, nothing written."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
import yaml

from adaptive_flot.studies.study_file import load_study
from adaptive_flot.studies.sweep import sweep
from tests.cli.conftest import Call, WriteScenario, WriteTable
from tests.studies.conftest import at_hand, cluster

__all__ = ["at_hand", "cluster"]

ESTIMATORS = {
    "raises": ("update", "raise KeyError('oops')", ["line 11: KeyError: 'oops'; correct"]),
    "fails in a constructor": ("__init__", "super().__init__(setup); len(3)", ["line 11: TypeError: object of type"]),
    "exits": ("update", "sys.exit(3)", ["line 11: ends the program; correct"]),
    "exits in a constructor": ("__init__", "sys.exit()", ["line 11: ends the program"]),
    "returns nothing": ("update", "return None", ["line 10, Bad.update: returned None; return (state, Estimate)"]),
    "returns no estimate": ("update", "return state, 3", ["Bad.update: returned a tuple; return (state, Estimate)"]),
    "wrong shape": (
        "update",
        "s, e = super().update(state, sample); return s, replace(e, parameters=np.zeros(5))",
        ["Bad.update: Estimate.parameters has shape (5,); return an array of shape (2,)"],
    ),
    "no array": (
        "update",
        "s, e = super().update(state, sample); return s, replace(e, covariance=None)",
        ["Bad.update: Estimate.covariance is None; return an array of shape (2, 2)"],
    ),
}
CONTROLLERS = {
    "raises": ("decide", "raise ValueError('c')", ["line 11: ValueError: c; correct the plug-in"]),
    "returns nothing": ("decide", "return None", ["Bad.decide: returned None; return (state, Decision)"]),
    "wrong shape": (
        "decide",
        "s, d = super().decide(state, sample, estimate); return s, replace(d, inputs=np.zeros(7))",
        ["Bad.decide: Decision.inputs has shape (7,); return an array of shape (3,)"],
    ),
    "not a number": (
        "decide",
        "s, d = super().decide(state, sample, estimate); return s, replace(d, inputs=d.inputs * np.nan)",
        ["Bad.decide: Decision.inputs = [nan nan nan] is not finite"],
    ),
}
ARGUMENTS = {"__init__": "setup", "update": "state, sample", "decide": "state, sample, estimate"}
MODULES = {
    "exits": ("import sys\nsys.exit(4)\n", ["importing", "SystemExit: 4", "own_bad.py, line 2"]),
    "raises": ("x = 1\nraise ValueError('no')\n", ["importing", "ValueError: no", "own_bad.py, line 2"]),
    "makes nothing": ("def Bad(setup):\n    return None\n", ["is None without a method 'init'"]),
    "makes something else": ("def Bad(setup):\n    return 3\n", ["is a int without a method 'init'"]),
    "no function": ("Bad = 3\n", ["can not be made with no options", "not callable"]),
}


def _write(folder: Path, base: str, method: str, body: str) -> None:
    """A plug-in whose method begins in line 10."""
    module, _, name = base.rpartition(".")
    lines = ["import sys", "from dataclasses import replace", "", "import numpy as np", f"from {module} import {name}"]
    lines += [
        "",
        "",
        f"class Bad({name}):",
        "    # a method of the user",
        f"    def {method}(self, {ARGUMENTS[method]}):",
    ]
    (folder / "own_bad.py").write_text("\n".join([*lines, f"        {body}", ""]))


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """The module of a test is forgotten after it."""
    yield
    sys.modules.pop("own_bad", None)


def _run(call: Call, scenario: WriteScenario, folder: Path, kind: str, *says: str) -> None:
    scenario()
    result = call("run", "short.yaml", f"--{kind}", "own_bad:Bad", "--out", "out")
    assert result.code == 2 and result.out == "" and result.err.count("\n") == 1, result
    assert "own_bad" in result.err and all(part in result.err for part in says), result.err
    assert not (folder / "out").exists()


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_a_bad_estimator_is_one_line(call: Call, scenario: WriteScenario, tmp_path: Path, kind: str) -> None:
    method, body, says = ESTIMATORS[kind]
    _write(tmp_path, "estimators.fixed.Fixed", method, body)
    _run(call, scenario, tmp_path, "estimator", *says)


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_a_bad_controller_is_one_line(call: Call, scenario: WriteScenario, tmp_path: Path, kind: str) -> None:
    method, body, says = CONTROLLERS[kind]
    _write(tmp_path, "controllers.schedule.Schedule", method, body)
    _run(call, scenario, tmp_path, "controller", *says)


@pytest.mark.parametrize("kind", MODULES)
def test_a_bad_module_is_one_line(call: Call, scenario: WriteScenario, tmp_path: Path, kind: str) -> None:
    text, says = MODULES[kind]
    (tmp_path / "own_bad.py").write_text(text)
    _run(call, scenario, tmp_path, "estimator", *says)


def test_debug_shows_the_traceback_of_a_plugin(call: Call, scenario: WriteScenario, tmp_path: Path) -> None:
    _write(tmp_path, "estimators.fixed.Fixed", "update", "raise KeyError('oops')")
    result = call("run", scenario(), "--estimator", "own_bad:Bad", "--out", "out", "--debug")
    assert result.code == 2 and "Traceback" in result.err and "raise KeyError('oops')" in result.err
    assert "line 11: KeyError" in result.err.splitlines()[-1]


@pytest.mark.parametrize("kind", ["raises", "exits"])
def test_in_a_study_it_is_a_failed_run_with_that_line(
    scenario: WriteScenario, tmp_path: Path, at_hand: None, kind: str
) -> None:
    method, body, says = ESTIMATORS[kind]
    _write(tmp_path, "estimators.fixed.Fixed", method, body)
    scenario()
    study = {"description": "x", "scenarios": ["short.yaml"], "estimators": {"bad": {"use": "own_bad:Bad"}}}
    (tmp_path / "study.yaml").write_text(yaml.safe_dump({**study, "seeds": [1]}))
    sweep(load_study(tmp_path / "study.yaml"), tmp_path / "out")
    runs = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    assert runs["outcome"].tolist() == ["failed"] and "own_bad.py, " + says[0] in runs["message"][0]


def test_an_estimator_that_is_shown_the_truth_has_none_in_a_record(
    call: Call, table: WriteTable, tmp_path: Path
) -> None:
    result = call("estimate", table(), "--estimator", "oracle")
    assert result.code == 2 and result.err.count("\n") == 1 and "'oracle' is shown the true parameters" in result.err
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["estimate", "record.csv", "--fit", "n", "--fit", "n"], "'growth_exponent' is named twice"),
        (["estimate", "record.csv", "--fit", "n", "--fit", "growth_exponent"], "'growth_exponent' is named twice"),
        (["discover", "record.csv", "--limit", "air_flow=1e-3:2e-3", "--limit", "air_flow=0:1"], "'air_flow' is given"),
        (["run", "short.yaml", "--estimator", "fixed"], "'growth_exponent' is named twice"),
        (["run", "short.yaml", "--seed", str(2**70)], "--seed"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_given_twice_or_too_large_is_told(
    call: Call, table: WriteTable, scenario: WriteScenario, tmp_path: Path, arguments: list[str], says: str
) -> None:
    table()
    scenario({} if "--seed" in arguments else {"adapt.parameters": ["n", "n"]})
    result = call(*arguments)
    assert result.code == 2 and result.out == "" and says in result.err, result
    assert not (tmp_path / "results").exists()
