"""A batch over rows gives what the function gives for each row, however many threads share it."""

from __future__ import annotations

import multiprocessing
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.greybox.stepping import rows as module
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.rows import over_rows


def function() -> ca.Function:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 3)
    return ca.Function("f", [x, p], [ca.sin(x) * p[0], ca.jacobian(ca.exp(x) * p[1], x) + p[2]])


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("count", [1, 3, 101])
@pytest.mark.parametrize("as_machine_code", [False, True])
def test_rows_are_those_of_the_function(
    monkeypatch: pytest.MonkeyPatch, libraries: Path, threads: int, count: int, as_machine_code: bool
) -> None:
    """Also where the rows can not be shared evenly."""
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)
    if as_machine_code and compiler_problem() is not None:
        pytest.skip(f"nothing can be compiled here: {compiler_problem()}")
    monkeypatch.setattr(module, "core_count", lambda: threads)
    rng = np.random.default_rng(1)
    x, p = rng.standard_normal((count, 2)), rng.standard_normal(3)
    values, slopes = over_rows(function(), count, as_machine_code=as_machine_code)(x.T, p)
    for k in range(count):
        value, slope = function()(x[k], p)
        np.testing.assert_allclose(np.array(values)[:, k], np.array(value).ravel(), rtol=1e-15)
        np.testing.assert_allclose(np.array(slopes)[:, 2 * k : 2 * k + 2], np.array(slope), rtol=1e-15)


def test_several_processes_do_not_fight_for_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "core_count", lambda: 4)
    assert over_rows(function(), 8).class_name() == "ThreadMap"
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: object())
    assert over_rows(function(), 8).class_name() == "Map"
