"""A user's own files: an estimator or controller beside a scenario, a model beside a record."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import PluginError
from adaptive_flot.plugins import ESTIMATORS, load
from adaptive_flot.processes.registry import make_model
from adaptive_flot.runner.commands.estimate import estimate_record
from adaptive_flot.runner.commands.record_blocks import read_blocks
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.keys import Plugin
from adaptive_flot.runner.scenario.loading import load_scenario
from tests.estimators import toys
from tests.runner.conftest import WriteScenario

ESTIMATOR = """
from dataclasses import replace
from estimators.fixed import Fixed

class Shifted(Fixed):
    '''Fixed parameters, a share above those of the prior.'''

    def __init__(self, setup, share={share}):
        super().__init__(setup)
        self.share = share

    def init(self, prior):
        return super().init(replace(prior, parameters=prior.parameters * (1 + self.share)))
"""
CONTROLLER = """
from controllers.schedule import Schedule
from dataclasses import replace

class LowAir(Schedule):
    def decide(self, state, sample, estimate):
        state, decision = super().decide(state, sample, estimate)
        decision.inputs[0] *= 0.9
        return state, replace(decision, decided_by="low air")
"""
MODEL = """
from adaptive_flot.greybox import Model, Parameter, Quantity

def equations(m):
    m.derivative("x", m.parameter("gain") * m.input("u") - m.parameter("rate") * m.state("x"))
    m.output("y", m.state("x"))

def make_model():
    return Model(
        name="mine", states=(Quantity("x", "V", ""),), inputs=(Quantity("u", "V", ""),),
        parameters=(Parameter("rate", 0.3, "1/s", "", None, 0.01, 5.0, 0.3, None, "estimated"),
                    Parameter("gain", 1.0, "1/s", "", None, 0.0, 9.0, 1.0, None, "estimated")),
        outputs=(Quantity("y", "V", ""),), equations=equations)

def make_nothing():
    return None
"""

WriteModule = Callable[[str, str], str]


@pytest.fixture
def write_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[WriteModule]:
    """Write a module into the temporary folder; it is forgotten after the test."""

    def write(name: str, text: str) -> str:
        monkeypatch.delitem(sys.modules, name, raising=False)
        (tmp_path / f"{name}.py").write_text(text)
        return name

    yield write
    for file in tmp_path.rglob("*.py"):
        sys.modules.pop(file.stem, None)


def test_an_estimator_beside_the_scenario_runs_with_its_options(
    write_scenario: WriteScenario, write_module: WriteModule
) -> None:
    write_module("own_estimator", ESTIMATOR.format(share=0.1))
    plugin = {"use": "own_estimator:Shifted", "start": "nominal"}
    file = write_scenario({"estimators": {"default": plugin, "more": {**plugin, "options": {"share": 0.2}}}})
    default, more = run_scenario(load_scenario(file), seeds=[1])
    assert default.table["n_estimate"].iloc[-1] == pytest.approx(1.1)
    assert more.table["n_estimate"].iloc[-1] == pytest.approx(1.2)


def test_an_estimator_named_for_the_run_only(write_scenario: WriteScenario, write_module: WriteModule) -> None:
    write_module("own_estimator", ESTIMATOR.format(share=0.1))
    (run,) = run_scenario(load_scenario(write_scenario()), ["own_estimator:Shifted"], [1])
    assert run.estimator == "own_estimator:Shifted"
    assert run.table["n_estimate"].iloc[-1] == pytest.approx(1.1 * run.initial.values()[0])


def test_a_controller_beside_the_scenario_decides(write_scenario: WriteScenario, write_module: WriteModule) -> None:
    write_module("own_controller", CONTROLLER)
    controllers = {"schedule": {"use": "schedule"}, "low": {"use": "own_controller:LowAir"}}
    runs = run_scenario(load_scenario(write_scenario({"controllers": controllers})), ["fixed"], [1])
    assert [r.controller for r in runs] == ["schedule", "low"]
    np.testing.assert_allclose(runs[1].table["air_flow_m3_s"], 0.9 * runs[0].table["air_flow_m3_s"])
    assert (runs[1].table["decided_by"] == "low air").all()


def test_files_of_one_name_in_two_folders_are_two_files(tmp_path: Path, write_module: WriteModule) -> None:
    """Two scenarios, each with its own `same_name.py` beside it."""
    for folder, share in (("one", 0.1), ("two", 0.2)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "same_name.py").write_text(ESTIMATOR.format(share=share))
    found = [
        load("same_name:Shifted", ESTIMATORS, "estimator", tmp_path / folder).__init__.__defaults__
        for folder in ("one", "two")
    ]
    assert found == [(0.1,), (0.2,)]


@pytest.mark.parametrize("style", ["own_file.py:Shifted", "sub/own_file.py:Shifted", "{folder}/own_file.py:Shifted"])
def test_the_module_may_be_given_as_the_path_of_its_file(tmp_path: Path, write_module: WriteModule, style: str) -> None:
    (tmp_path / "sub").mkdir()
    for folder in (tmp_path, tmp_path / "sub"):
        (folder / "own_file.py").write_text(ESTIMATOR.format(share=0.1))
    assert load(style.format(folder=tmp_path), ESTIMATORS, "estimator", tmp_path).__name__ == "Shifted"


@pytest.mark.parametrize(
    ("address", "text", "says"),
    [
        ("rpm", "", "unknown estimator 'rpm'; did you mean 'rpem'"),
        ("own_missing:Mine", "", "no module 'own_missing'"),
        ("own_broken:Mine", "x = 1 +", "importing 'own_broken' failed: SyntaxError"),
        ("own_broken:Mine", "raise ValueError('no')", "importing 'own_broken' failed: ValueError: no"),
        ("own_broken:Mine", "import not_there_either", "own_broken.py imports 'not_there_either', which is not there"),
        ("own_broken:Myne", "class Mine: pass", "has no 'Myne'; did you mean 'Mine'"),
        ("own_broken:", "class Mine: pass", "has no ''"),
        (":Mine", "", "estimator ':Mine'"),
    ],
)
def test_what_can_not_be_loaded_is_one_line(
    tmp_path: Path, write_module: WriteModule, address: str, text: str, says: str
) -> None:
    if text:
        write_module("own_broken", text)
    with pytest.raises(PluginError) as caught:
        load(address, ESTIMATORS, "estimator", tmp_path)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_a_module_may_import_its_neighbours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the command is given from: a model of one's own is often more than one file."""
    monkeypatch.setattr(sys, "path", sys.path[:])
    monkeypatch.chdir("/")
    (tmp_path / "own_neighbour.py").write_text("SHARE = 0.25")
    (tmp_path / "own_importer.py").write_text("from own_neighbour import SHARE\n\ndef make(): return SHARE")
    made = load(f"{tmp_path}/own_importer.py:make", {}, "model", None)
    assert made() == 0.25


def test_a_model_beside_the_record_is_fitted(tmp_path: Path, write_module: WriteModule) -> None:
    """A record of x+ = ... with rate 0.5 and gain 2, made by the toy of the same equations."""
    write_module("own_model", MODEL)
    generator = np.random.default_rng(0)
    data = toys.record(toys.decay(), np.repeat(generator.normal(size=30), 4), parameters={"a": 0.5, "b": 2.0})
    noisy = data.outputs[:, 0] + 0.05 * generator.normal(size=len(data))
    file = tmp_path / "record.csv"
    pd.DataFrame({"time_s": data.time, "u_V": data.inputs[:, 0], "y_V": noisy}).to_csv(file, index=False)
    model = make_model("own_model:make_model", folder=tmp_path)
    result = estimate_record(read_blocks(file, model, 0.6), model)
    rate, gain = result.batch.estimates
    assert abs(rate.value - 0.5) < 4 * rate.std < 0.2 and abs(gain.value - 2.0) < 4 * gain.std < 0.8
    errors = {(r.estimator, e.block): e for r in result.replays for e in r.errors}
    assert errors["pem", "test"].free_run == pytest.approx(0.05, rel=0.3)
    assert errors["pem", "test"].free_run < 0.2 * errors["fixed", "test"].free_run


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("own_model:make_nothing", "returned a NoneType; return a Model"),
        ("own_model:equations", "equations"),
        ("own_model", "unknown model 'own_model'"),
    ],
)
def test_what_is_no_model_is_one_line(tmp_path: Path, write_module: WriteModule, name: str, says: str) -> None:
    write_module("own_model", MODEL)
    with pytest.raises(PluginError) as caught:
        make_model(name, folder=tmp_path)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_a_class_given_in_python_estimates_like_the_same_class_by_name(tmp_path: Path) -> None:
    """A notebook has its estimator as a class with options, and nowhere a file of it."""
    (tmp_path / "tanks.csv").write_text(_tanks())
    model = make_model("cascaded-tanks")
    blocks = read_blocks(tmp_path / "tanks.csv", model, 0.6)

    class Mine(load("rpem", ESTIMATORS, "estimator")):  # type: ignore[misc]
        """A class that no address can reach."""

    options = {"forgetting": 0.9}
    plugins = {"by name": Plugin(use="rpem", options=options), "given": Plugin.of(Mine, options)}
    plugins["default"] = Plugin(use="rpem")
    by_name, given, default = (r.table for r in estimate_record(blocks, model, estimators=plugins).replays)
    pd.testing.assert_frame_equal(by_name, given)
    assert not by_name.equals(default), "the options must reach the constructor"
    with pytest.raises(PluginError, match="'Mine' can not be made with frogetting=1"):
        estimate_record(blocks, model, estimators={"x": Plugin.of(Mine, {"frogetting": 1})})


def _tanks() -> str:
    rng = np.random.default_rng(1)
    rows = (f"{u:.4f},{u:.4f},{y:.4f},{y:.4f},4" for u, y in rng.uniform((2, 4), (4, 6), (60, 2)))
    return "\n".join(("uEst,uVal,yEst,yVal,Ts", *rows))
