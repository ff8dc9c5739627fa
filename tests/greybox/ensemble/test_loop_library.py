"""A compiled function called for one member after the other gives, to the bit, what it gives when called alone."""

from __future__ import annotations

import warnings
from pathlib import Path
from unittest.mock import patch

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox.ensemble import lane_library
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import CompileWarning, compiler_problem
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
MATRICES = ("S", "S_next")


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)


def filter_step() -> ca.Function:
    """An MX function with a vector and a matrix that are carried, an argument of each row, and one that is fixed."""
    x, S, u, g = ca.MX.sym("x", 2), ca.MX.sym("S", 2, 2), ca.MX.sym("u", 2), ca.MX.sym("g")
    F = ca.vertcat(ca.horzcat(0.9, 0.1 * g), ca.horzcat(-0.2, ca.exp(-(u[0] ** 2))))
    x_next = ca.mtimes(F, x) + ca.tanh(u)
    S_next = ca.mtimes(ca.mtimes(F, S), F.T) + ca.DM.eye(2)
    y = ca.mtimes(x_next.T, ca.solve(S_next, x_next))
    return ca.Function("loop_step", [x, S, u, g], [x_next, S_next, y], ["x", "S", "u", "g"], ["x_next", "S_next", "y"])


def alone(step: FastCall, x: FloatArray, S: FloatArray, u: FloatArray, g: float) -> tuple[FloatArray, ...]:
    """Results of a member row by row: x_next (K, 2), S_next (K, 2, 2), y (K, 1)."""
    rows = []
    for now in u:
        x, S, y = step(x, S, now, g)
        rows.append((x, S, y))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


@needs_compiler
@pytest.mark.parametrize("threads", [1, 2])
@settings(deadline=None, max_examples=20)
@given(members=st.integers(1, 9), rows=st.integers(1, 6), seed=st.integers(0, 2**16))
def test_each_member_has_the_bits_of_the_function_called_alone(
    threads: int, members: int, rows: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    x, u, g = rng.normal(size=(members, 2)), rng.normal(size=(members, rows, 2)), rng.normal(size=(members, 1))
    half = rng.normal(size=(members, 2, 3))
    S = half @ half.transpose(0, 2, 1)
    step = FastCall(filter_step(), MATRICES, as_machine_code=True)
    with warnings.catch_warnings(), patch.object(lane_library, "worker_threads", lambda: threads):
        warnings.simplefilter("error", CompileWarning)
        lanes = Lanes(filter_step(), {"x": "x_next", "S": "S_next"}, MATRICES, as_machine_code=True, one_by_one=True)
        found = lanes(members, rows, {"x": x, "S": S, "g": g}, {"u": u}, every=["x_next", "y"], last=["S_next"])
    for m in range(members):
        x_next, S_next, y = alone(step, x[m], S[m], u[m], float(g[m, 0]))
        np.testing.assert_array_equal(found["x_next"][m], x_next)
        np.testing.assert_array_equal(found["y"][m], y)
        np.testing.assert_array_equal(found["S_next"][m], S_next[-1])


def test_without_a_compiler_members_are_those_of_casadis_map() -> None:
    """Also a member that is no number stays alone."""
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=(3, 2)), rng.normal(size=(3, 4, 2))
    x[1] = np.nan
    S, g, carried = np.eye(2), np.array([0.5]), {"x": "x_next", "S": "S_next"}
    found = Lanes(filter_step(), carried, MATRICES, one_by_one=True)(
        3, 4, {"x": x, "S": S, "g": g}, {"u": u}, every=["y"]
    )
    step = FastCall(filter_step(), MATRICES)
    for m in (0, 2):
        np.testing.assert_allclose(found["y"][m], alone(step, x[m], S, u[m], 0.5)[2], rtol=1e-12)
    assert np.isnan(found["y"][1]).all()
