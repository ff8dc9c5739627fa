"""Machine code gives the numbers of the interpreted expression and is kept safely; without it nothing breaks."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic, sleep

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling import compiled as module
from adaptive_flot.greybox.stepping.compiling.compiled import (
    CompileWarning,
    compile_function,
    compiled,
    compiler_problem,
)
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.plugins import ESTIMATORS, load
from adaptive_flot.testing.cases import estimator_case, run_estimator
from estimators.rpem.estimator import Rpem

NAMES = ("growth_exponent", "coalescence_rate")
PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache") / "compiled"


@pytest.fixture(autouse=True)
def own_cache(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tests neither use nor fill the user's cache."""
    monkeypatch.setattr(module, "cache_folder", lambda: folder)
    yield
    module._compiler.cache_clear()


def function(slope: float = 2.0) -> ca.Function:
    x = ca.SX.sym("x", 2)
    return ca.Function("f", [x], [slope * ca.sin(x) + x[0] ** 1.7, ca.jacobian(ca.exp(x), x)], ["x"], ["y", "J"])


def same(found: FloatArray, expected: FloatArray) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0)


@needs_compiler
def test_records_and_their_sensitivities_are_those_of_the_plain_step(model: Model) -> None:
    rng = np.random.default_rng(1)
    u = np.column_stack([np.linspace(9.05e-4, 2.1e-3, 200), np.full(200, 1.67e-4), rng.uniform(0.35, 0.42, 200)])
    x0, p = steady_state(model, u[0]).state, model.parameter_values
    plain, quick = Stepper(model, 1.0), Stepper(replace(model, compiled=True), 1.0)
    for a, b in zip(quick.call(x0, 0.0, u[1], p), plain.call(x0, 0.0, u[1], p), strict=True):
        same(a, b)
    assert quick.call.function.is_a("External") and not plain.call.function.is_a("External")
    same(quick.simulate(x0, u).states, plain.simulate(x0, u).states)
    found, expected = (s.simulate_sensitivities(x0, u, p, NAMES, np.zeros((9, 2))) for s in (quick, plain))
    same(found.outputs, expected.outputs)
    same(found.gradient, expected.gradient)
    same(found.last_state_gradient, expected.last_state_gradient)


@needs_compiler
@pytest.mark.parametrize("name", ["fixed", "rpem", "rpem_full"])
def test_estimates_are_those_of_the_plain_estimator(model: Model, name: str) -> None:
    """Over 40 samples, so that a difference of the step would grow; one of them with a missing measurement."""
    factory = load(name, ESTIMATORS, "estimator")
    runs = []
    for candidate in (model, replace(model, compiled=True)):
        case = estimator_case(factory, model=candidate)
        samples = list(case.samples)
        samples[7] = replace(samples[7], outputs=np.full_like(samples[7].outputs, np.nan))
        runs.append(run_estimator(case.estimator, case.estimator.init(case.prior), samples)[1])
    same_estimates(*runs)


@needs_compiler
@pytest.mark.parametrize(("name", "functions"), [("ekf", 1), ("imm", 3), ("adaptive_imm", 1)])
def test_filters_are_those_of_the_plain_filter(clock: Model, name: str, functions: int) -> None:
    """On a small model: with the cell the compiler takes ten seconds."""
    samples = [Sample(0.1 * k, np.array([1.0]), np.array([2.0 * np.sin(0.1 * k) + 0.2 * k])) for k in range(1, 41)]
    prior = Prior(0.0, np.zeros(1), np.array([1.8]), np.array([[0.04]]), np.array([0.01]))
    runs = []
    for candidate in (clock, replace(clock, compiled=True)):
        estimator = load(name, ESTIMATORS, "estimator")(Setup(candidate, 0.1, ("k",), ("y",)))
        assert [f.function.is_a("External") for f in vars(estimator).values() if isinstance(f, FastCall)] == [
            candidate.compiled
        ] * functions
        runs.append(run_estimator(estimator, estimator.init(prior), samples)[1])
    same_estimates(*runs)


@needs_compiler
def test_whole_records_are_those_of_the_plain_estimator(clock: Model) -> None:
    """The loop over the samples is compiled too."""
    time = np.linspace(0.1, 25.0, 250)
    y = (2.0 * np.sin(time) + 2.0 * time)[:, None]
    prior = Prior(0.0, np.zeros(1), np.array([1.8]), np.array([[0.04]]), np.array([0.01]))
    tracks = []
    for candidate in (clock, replace(clock, compiled=True)):
        estimator = Rpem(Setup(candidate, 0.1, ("k",), ("y",)))
        tracks.append(estimator.track(estimator.init(prior), time, np.ones((250, 1)), y))
    for what in ("parameters", "state", "prediction", "covariance"):
        same(getattr(tracks[1], what), getattr(tracks[0], what))


def same_estimates(plain: Sequence[Estimate], quick: Sequence[Estimate]) -> None:
    for expected, found in zip(plain, quick, strict=True):
        assert expected.status is found.status
        for what in ("parameters", "state", "prediction", "innovation_std", "covariance"):
            same(getattr(found, what), getattr(expected, what))


@needs_compiler
def test_nan_passes_through() -> None:
    y, _ = FastCall(function(), as_machine_code=True)(np.array([np.nan, 1.0]))
    assert np.isnan(y).all()


@needs_compiler
def test_second_time_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    first = compile_function(function(3.0))
    monkeypatch.setattr(module, "_build", None)
    same(np.array(compile_function(function(3.0))([0.1, 0.2])[0]), np.array(first([0.1, 0.2])[0]))


@needs_compiler
def test_another_expression_or_another_compiler_is_another_library(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compile_function(function(4.0))
    before = set(folder.glob("f-*.so"))
    compile_function(function(5.0))
    other = script(tmp_path / "other", f'[ "$1" = --version ] && echo other 1.0 || exec {real_compiler()} "$@"')
    monkeypatch.setenv("CC", str(other))
    compile_function(function(4.0))
    assert len(set(folder.glob("f-*.so")) - before) == 2


@needs_compiler
def test_a_broken_library_is_made_again(folder: Path) -> None:
    """A disk that was full, a file cut off by a crash of the machine."""
    known = set(folder.glob("*"))
    compile_function(function(6.0))
    (library,) = set(folder.glob("*")) - known
    whole = library.read_bytes()
    library.unlink()
    library.write_bytes(whole[:100])
    found = compile_function(function(6.0))
    assert library.read_bytes()[:4] == whole[:4] and library.stat().st_size > 100
    same(np.array(found([0.1, 0.2])[0]), np.array(function(6.0)([0.1, 0.2])[0]))


RACER = """
import sys, time
from pathlib import Path
import casadi as ca
from adaptive_flot.greybox.stepping.compiling import compiled as module
folder = Path(sys.argv[1])
module.cache_folder = lambda: folder / "cache"
x = ca.SX.sym("x", 3)
y = x
for _ in range(200):
    y = ca.sin(y) + x
f = ca.Function("raced", [x], [y])
(folder / f"ready-{sys.argv[2]}").touch()
while not (folder / "go").exists():
    time.sleep(0.001)
for _ in range(5):
    found = module.compile_function(f)
    assert found.is_a("External") and (found([0.1, 0.2, 0.3]) == f([0.1, 0.2, 0.3])).is_one()
"""


@needs_compiler
def test_processes_that_want_the_same_function_at_once(tmp_path: Path) -> None:
    """Each gets a whole library, none fails, and nothing but the library is left behind."""
    racers = [
        subprocess.Popen([sys.executable, "-c", RACER, str(tmp_path), str(i)], stderr=subprocess.PIPE, text=True)
        for i in range(4)
    ]
    end = monotonic() + 60
    while len(list(tmp_path.glob("ready-*"))) < len(racers) and monotonic() < end:
        sleep(0.01)
    (tmp_path / "go").touch()
    errors = [racer.communicate(timeout=60)[1] for racer in racers]
    assert [racer.returncode for racer in racers] == [0] * len(racers), errors
    (left,) = (tmp_path / "cache").iterdir()
    assert left.suffix == ".so"


def test_without_a_compiler_the_plain_step_is_used(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    problem = compiler_problem()
    assert problem is not None and "no C compiler found (looked for cc, gcc, clang" in problem
    u = np.tile([1.5e-3, 1.67e-4, 0.38], (5, 1))
    x0 = steady_state(model, u[0]).state
    with pytest.warns(CompileWarning, match="step is not compiled: no C compiler found"):
        found = Stepper(replace(model, compiled=True), 1.0).simulate(x0, u)
    np.testing.assert_array_equal(found.states, Stepper(model, 1.0).simulate(x0, u).states)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "looked for .*broken, which the variable CC names"),
        ("exit 3", r"failed on its version \(exit code 3\)"),
        ('[ "$1" = --version ] && echo broken 1 || { echo "line" >&2; echo "cannot find -lm" >&2; exit 1; }', "-lm"),
        ('[ "$1" = --version ] && echo silent 1 || exit 0', "can not be kept"),
    ],
    ids=["not there", "no version", "fails", "writes nothing"],
)
def test_a_compiler_that_does_not_work_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None, words: str
) -> None:
    path = tmp_path / "broken"
    monkeypatch.setenv("CC", str(path if content is None else script(path, content)))
    with pytest.warns(CompileWarning, match=words):
        assert not compiled(function(7.0)).is_a("External")


@needs_compiler
def test_a_cache_that_can_not_be_written_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(module, "cache_folder", lambda: tmp_path / "file")
    problem = compiler_problem()
    assert problem is not None and f"can not be kept in {tmp_path / 'file'}" in problem


def real_compiler() -> str:
    return module.find_compiler().command[0]


def script(path: Path, content: str) -> Path:
    """An executable that stands for a compiler."""
    path.write_text(f"#!/bin/sh\n{content}\n")
    path.chmod(0o755)
    return path
