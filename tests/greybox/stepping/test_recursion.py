"""A recursion is the Python loop over its function, rows and carried matrices in their places."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.stepping import recursion
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, compiler_problem
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.greybox.stepping.recursion import Recursion, row_by_row
from adaptive_flot.greybox.stepping.whole_record import tape_recursion
from adaptive_flot.greybox.stepping.whole_record.tape_recursion import TapeRecursion

ROWS = 30


def function() -> ca.Function:
    """Carried arguments are neither first nor alone, and one is a matrix that is not symmetric."""
    u, x, c, P = ca.SX.sym("u", 2), ca.SX.sym("x", 2), ca.SX.sym("c", 3), ca.SX.sym("P", 2, 2)
    x_next = 0.5 * P @ x + u + c[0]
    P_next = 0.9 * P + 0.1 * ca.horzcat(x, c[1:])
    return ca.Function("f", [u, x, c, P], [x.T @ u, x_next, P_next], ["u", "x", "c", "P"], ["y", "x_next", "P_next"])


def test_is_the_loop_over_its_function() -> None:
    rng = np.random.default_rng(3)
    u, c = rng.standard_normal((ROWS, 2)), rng.standard_normal(3)
    x, P = rng.standard_normal(2), rng.standard_normal((2, 2))
    found = Recursion(function(), {"x": "x_next", "P": "P_next"}, ROWS)({"x": x, "P": P}, {"u": u, "c": c})
    one = FastCall(function(), matrices=("P", "P_next"))
    for k in range(ROWS):
        y, x, P = one(u[k], x, c, P)
        np.testing.assert_allclose(found["y"][k], y, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(found["x_next"][k], x, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(found["P_next"][k], P, rtol=1e-12, atol=1e-14)
    assert found["P_next"].shape == (ROWS, 2, 2) and found["y"].shape == (ROWS, 1)


@pytest.mark.parametrize("carried", [{"X": "x_next"}, {"x": "next"}])
def test_an_unknown_name_to_carry_is_named(carried: dict[str, str]) -> None:
    with pytest.raises(ModelError, match=r"f: has no '(X|next)' to carry"):
        Recursion(function(), carried, ROWS)


def test_another_number_of_rows_is_refused() -> None:
    recursion = Recursion(function(), {"x": "x_next", "P": "P_next"}, ROWS)
    with pytest.raises(ModelError, match="'u' has the shape"):
        recursion({"x": np.ones(2), "P": np.eye(2)}, {"u": np.ones((ROWS - 1, 2)), "c": np.ones(3)})


CARRIED = {"x": "x_next", "P": "P_next"}
NEXT = tuple(CARRIED.values())


def _without_compiler(monkeypatch: pytest.MonkeyPatch) -> recursion.RowByRow:
    def refused(*given: object) -> None:
        raise CompileError("no compiler")

    with monkeypatch.context() as m:
        m.setattr(recursion, "TapeRecursion", refused)
        return row_by_row(function(), CARRIED, ("c",))


@pytest.mark.skipif(compiler_problem() is not None, reason="no compiler")
@pytest.mark.parametrize("worth", [0, tape_recursion.WORTH_COMPILING])
@pytest.mark.parametrize("rows", [1, 99, 100, 101, 250])
def test_with_and_without_a_compiler_it_has_the_same_numbers_to_the_bit(
    rows: int, worth: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For any number of rows; the tape by one call, read or compiled, CasADi by as many as it takes."""
    monkeypatch.setattr(tape_recursion, "WORTH_COMPILING", worth)
    rng = np.random.default_rng(rows)
    given = {"x": rng.standard_normal(2), "P": rng.standard_normal((2, 2))}
    each = {"u": rng.standard_normal((rows, 2)), "c": rng.standard_normal(3)}
    plain, tape = _without_compiler(monkeypatch), row_by_row(function(), CARRIED, ("c",))
    assert isinstance(tape, TapeRecursion) and not isinstance(plain, TapeRecursion)
    one, other = plain(given, each), tape(given, each)
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(value, other[name])
        np.testing.assert_array_equal(value, tape(given, each)[name])  # it keeps nothing from call to call


@pytest.mark.skipif(compiler_problem() is not None, reason="no compiler")
@settings(max_examples=30, deadline=None)
@given(held=st.sets(st.sampled_from(["c", "d"])), changes=st.booleans(), rows=st.integers(1, 40))
def test_what_is_held_is_worked_out_once_with_the_same_result(held: set[str], changes: bool, rows: int) -> None:
    x, u, c, d = (ca.SX.sym(name) for name in "xucd")
    f = ca.Function("f", [u, d, x, c], [ca.exp(-c * d) * x + u * ca.sqrt(d), d * c], list("udxc"), ["x_next", "y"])
    rng = np.random.default_rng(rows)
    each = {"u": rng.normal(size=(rows, 1)), "c": np.array([0.3]), "d": np.array([1.7])}
    if changes and "d" not in held:
        each["d"] = rng.uniform(0.5, 2.0, (rows, 1))
    found = row_by_row(f, {"x": "x_next"}, held)({"x": np.array([0.5])}, each)
    at, table = 0.5, np.broadcast_to(each["d"], (rows, 1))
    for k in range(rows):
        at = float(np.exp(-0.3 * table[k, 0]) * at + each["u"][k, 0] * np.sqrt(table[k, 0]))
        assert found["x_next"][k, 0] == pytest.approx(at, rel=1e-13)
        assert found["y"][k, 0] == pytest.approx(0.3 * table[k, 0], rel=1e-13)


@pytest.mark.skipif(compiler_problem() is not None, reason="no compiler")
def test_a_wrong_shape_is_refused_before_anything_is_read() -> None:
    run, given = row_by_row(function(), CARRIED, ("c",)), {"x": np.ones(2), "P": np.eye(2)}
    for each in ({"u": np.ones((5, 3)), "c": np.ones(3)}, {"u": np.ones((5, 2)), "c": np.ones((5, 3))}):
        with pytest.raises(ValueError, match=r"(u|c): shape"):
            run(given, each)
    with pytest.raises(ValueError, match="x: shape"):
        run(given | {"x": np.ones(3)}, {"u": np.ones((5, 2)), "c": np.ones(3)})


@pytest.mark.skipif(compiler_problem() is not None, reason="no compiler")
@given(st.integers(1, 19), st.integers(0, 2**32 - 1), st.booleans())
@settings(deadline=None)
def test_members_side_by_side_have_the_numbers_that_each_has_alone(members: int, seed: int, compiled: bool) -> None:
    """To the last bit, whatever the vector instructions: a search by likelihood is the same with and without them.

    Read or compiled.
    """
    x, P, u, c = ca.SX.sym("x", 2), ca.SX.sym("P", 2, 2), ca.SX.sym("u", 2), ca.SX.sym("c", 3)
    x_next = ca.tanh(P @ x) + ca.sqrt(ca.fabs(u)) * ca.exp(-c[0]) + ca.fmin(c[1], x) / (1 + c[2] ** 2)
    P_next = 0.9 * P + 0.1 * ca.horzcat(ca.if_else(x > 0, x, c[:2]), ca.sign(x) * ca.fabs(x) ** 1.7)
    f = ca.Function("f", [x, P, u, c], [x_next, P_next, ca.log(1 + x.T @ x)], ["x", "P", "u", "c"], [*NEXT, "y"])
    recursion = row_by_row(f, CARRIED, ("c",))
    assert isinstance(recursion, TapeRecursion)
    rng = np.random.default_rng(seed)
    shapes = {"x": (2,), "P": (2, 2), "u": (ROWS, 2), "c": (3,)}
    values = [{name: rng.standard_normal(shape) for name, shape in shapes.items()} for _ in range(members)]
    values[0]["u"][ROWS // 2, 0] = np.nan  # stays with its member
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tape_recursion, "WORTH_COMPILING", 0 if compiled else 10**9)
        patch.setattr(tape_recursion, "is_kept", lambda *given: False)
        found = recursion.side_by_side(values, "y")
    for own, each in zip(found, values, strict=True):
        alone = recursion({k: each[k] for k in CARRIED}, {k: each[k] for k in ("u", "c")})
        np.testing.assert_array_equal(own, alone["y"])


@pytest.mark.skipif(compiler_problem() is not None, reason="no compiler")
def test_members_of_other_shapes_are_refused() -> None:
    recursion = row_by_row(function(), CARRIED, ("c",))
    assert isinstance(recursion, TapeRecursion)
    one = {"x": np.ones(2), "P": np.eye(2), "u": np.ones((ROWS, 2)), "c": np.ones(3)}
    with pytest.raises(ValueError, match="other shapes"):
        recursion.side_by_side([one, {**one, "u": np.ones((ROWS - 1, 2))}], "y")
