"""A function in lanes gives what CasADi gives for each member alone, whatever stands in the lanes beside it."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.ensemble import lane_library
from adaptive_flot.greybox.ensemble.lanes import Lanes
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, CompileWarning, compiler_problem
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import BY_LEVEL, SCALAR, InstructionSet, supported

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
SETS = [pytest.param(s, marks=needs_compiler, id=s.name) for s in BY_LEVEL]
WAYS = [pytest.param(None, id="map"), *SETS]


def lanes_of(function: ca.Function, way: InstructionSet | None, carried: dict[str, str] | None = None) -> Lanes:
    if way is None:
        return Lanes(function, carried or {}, ("S", "S_next"))
    if way not in supported():
        pytest.skip(f"this machine has no {way.name}")
    with warnings.catch_warnings():
        warnings.simplefilter("error", CompileWarning)
        return Lanes(function, carried or {}, ("S", "S_next"), as_machine_code=True, instructions=way)


# -- random models -----------------------------------------------------------------------------------------------------

PAIRS: dict[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "add": lambda a, b: a + b,
    "mul": lambda a, b: a * b / (1 + b),
    "div": lambda a, b: a / b,
    "pow": lambda a, b: a ** (b / (1 + b)),
    "min": ca.fmin,
    "max": ca.fmax,
    "if": lambda a, b: ca.if_else(a < b, a, 2 * b),
    "hypot": lambda a, b: ca.sqrt(a**2 + b**2),
    "atan2": ca.atan2,
}
SINGLES: dict[str, Callable[[ca.SX], ca.SX]] = {
    "sqrt": ca.sqrt,
    "exp": lambda a: ca.exp(-a / (1 + a)),
    "log": lambda a: ca.log(1 + a),
    "power": lambda a: (1 + a) ** -1.39,
    "square": lambda a: a**2 / (1 + a),
    "tanh": lambda a: ca.tanh(a),
    "sin": lambda a: 1.5 + ca.sin(a / (1 + a)),
    "half": lambda a: a / 2,
}


def expressions(leaves: int) -> st.SearchStrategy[object]:
    """Trees of positive quantities without differences, so that rounding is not magnified."""
    return st.recursive(
        st.integers(0, leaves - 1),
        lambda inner: st.one_of(
            st.tuples(st.sampled_from(sorted(PAIRS)), inner, inner), st.tuples(st.sampled_from(sorted(SINGLES)), inner)
        ),
        max_leaves=12,
    )


def written(tree: object, leaves: list[ca.SX]) -> ca.SX:
    if isinstance(tree, int):
        return leaves[tree]
    assert isinstance(tree, tuple)
    name, *branches = tree
    operands = [written(b, leaves) for b in branches]
    return SINGLES[name](*operands) if len(operands) == 1 else PAIRS[name](*operands)


@pytest.mark.parametrize("way", WAYS)
@given(trees=st.lists(expressions(5), min_size=2, max_size=2), members=st.integers(1, 11), seed=st.integers(0, 2**16))
def test_random_models_give_the_numbers_of_the_plain_step(
    way: InstructionSet | None, trees: list[object], members: int, seed: int
) -> None:
    x, u, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("p", 2)
    gains = ca.vertcat(*(written(tree, [*ca.vertsplit(ca.vertcat(x, u, p))]) for tree in trees))
    gains = gains / (1 + gains)  # what comes back is bounded: the model is stable
    function = ca.Function("random", [x, u, p], [0.5 * x + gains, gains], ["x", "u", "p"], ["x_next", "y"])
    rng = np.random.default_rng(seed)
    rows = 6
    x0, u_rows, each = (
        rng.uniform(0.5, 2, (members, 2)),
        rng.uniform(0.5, 2, (rows, 1)),
        rng.uniform(0.5, 2, (members, 2)),
    )
    found = lanes_of(function, way, {"x": "x_next"})(
        members, rows, {"x": x0, "p": each}, {"u": u_rows}, every=["y"], last=["x_next"]
    )
    for m in range(members):
        state = x0[m]
        for row in range(rows):
            state, y = (np.array(r).ravel() for r in function(state, u_rows[row], each[m]))
            np.testing.assert_allclose(found["y"][m, row], y, rtol=1e-12, atol=0)
        np.testing.assert_allclose(found["x_next"][m], state, rtol=1e-12, atol=0)


# -- every operation ---------------------------------------------------------------------------------------------------

Binary = Callable[[ca.SX, ca.SX], ca.SX]
VALUES = np.array([0.0, -0.0, 1.0, -1.0, 0.3, -0.7, 2.0, -3.0, 5.5, 1e-300, 1e300, 709.0, -745.0, np.inf, np.nan])
UNARY: list[Callable[[ca.SX], ca.SX]] = [
    *(ca.sqrt, ca.exp, ca.log, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh),
    *(ca.acosh, ca.atanh, ca.floor, ca.ceil, ca.erf, ca.fabs, ca.sign, ca.log1p, ca.expm1, ca.logic_not),
    *(lambda a: -a, lambda a: a**2, lambda a: 2 * a, lambda a: 1 / a),
    *(lambda a: a**-1.39, lambda a: a**3, lambda a: a**0.5, lambda a: a**-4),
]
VECTORS: list[Binary] = [
    *(ca.fmin, ca.fmax, ca.atan2, ca.copysign, ca.hypot, ca.power, ca.logic_and, ca.logic_or),
    *(lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b),
    *(lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b, lambda a, b: a != b),
    lambda a, b: ca.if_else(a < b, a, b),
]
NO_VECTORS: list[Binary] = [ca.fmod, ca.remainder]
"""A loop with one of these is not made of vector instructions."""


@pytest.mark.parametrize("way", SETS)
@pytest.mark.parametrize("binary", [VECTORS, NO_VECTORS], ids=["vectors", "others"])
def test_every_operation_at_ordinary_and_at_special_values(way: InstructionSet, binary: list[Binary]) -> None:
    """Zero, infinity and NaN too: a branch that is not taken may hold them."""
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    results = [*(f(a) for f in UNARY if binary is VECTORS), *(f(a, b) for f in binary)]
    function = ca.Function("all", [a, b], [ca.vertcat(*results)], ["a", "b"], ["y"])
    pairs = np.array([(v, w) for v in VALUES for w in VALUES])
    found = lanes_of(function, way)(len(pairs), 1, {"a": pairs[:, :1], "b": pairs[:, 1:]}, {}, last=["y"])["y"]
    expected = np.array([np.array(function(*pair)).ravel() for pair in pairs])
    np.testing.assert_allclose(found, expected, rtol=1e-12 if way.lanes > 1 else 0, atol=0)


# -- members -----------------------------------------------------------------------------------------------------------


def filter_like() -> ca.Function:
    """A state and a matrix carried along, an input, a parameter, and a result that nothing depends on."""
    x, S, u, p = ca.SX.sym("x", 3), ca.SX.sym("S", 3, 2), ca.SX.sym("u", 2), ca.SX.sym("p", 2)
    A = ca.horzcat(ca.exp(-p[0] * x), ca.sin(x), ca.SX([0.1, 0.2, 0.3]))
    x_next = A @ x / 3 + ca.vertcat(u, p[1] ** 0.7)
    return ca.Function(
        "filter_like",
        [x, S, u, p],
        [x_next, A @ S + x_next @ u.T, ca.vertcat(ca.sumsqr(x_next), 7.0)],
        ["x", "S", "u", "p"],
        ["x_next", "S_next", "y"],
    )


def tables(members: int, rows: int) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    rng = np.random.default_rng(3)
    fixed = {"x": rng.uniform(size=(members, 3)), "S": rng.uniform(size=(members, 3, 2))}
    return fixed | {"p": rng.uniform(0.5, 1, size=(members, 2))}, {"u": rng.uniform(size=(members, rows, 2))}


@pytest.mark.parametrize("way", WAYS)
def test_vectors_and_matrices_come_back_in_the_shapes_they_went_in(way: InstructionSet | None) -> None:
    function, rows, members = filter_like(), 5, 11
    fixed, by_row = tables(members, rows)
    lanes = lanes_of(function, way, {"x": "x_next", "S": "S_next"})
    found = lanes(members, rows, fixed, by_row, every=["S_next", "y"], last=["x_next"])
    assert {name: value.shape for name, value in found.items()} == {
        **{"S_next": (11, 5, 3, 2), "y": (11, 5, 2), "x_next": (11, 3)}
    }
    for m in range(members):
        x, S = fixed["x"][m], fixed["S"][m]
        for row in range(rows):
            x, S, y = (np.array(r) for r in function(x, S, by_row["u"][m, row], fixed["p"][m]))
            np.testing.assert_allclose(found["S_next"][m, row], S, rtol=1e-12)
            np.testing.assert_allclose(found["y"][m, row], y.ravel(), rtol=1e-12)
        np.testing.assert_allclose(found["x_next"][m], x.ravel(), rtol=1e-12)


@pytest.mark.parametrize("way", WAYS)
def test_what_all_members_share_need_not_be_repeated(way: InstructionSet | None) -> None:
    fixed, by_row = tables(5, 4)
    lanes = lanes_of(filter_like(), way, {"x": "x_next", "S": "S_next"})
    shared = lanes(5, 4, fixed | {"S": fixed["S"][0]}, {"u": by_row["u"][0]}, every=["y", "S_next"])
    repeated = lanes(
        5,
        4,
        fixed | {"S": np.repeat(fixed["S"][:1], 5, 0)},
        {"u": np.repeat(by_row["u"][:1], 5, 0)},
        every=["y", "S_next"],
    )
    for name in ("y", "S_next"):
        np.testing.assert_array_equal(shared[name], repeated[name])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("threads", [1, 3])
def test_a_member_does_not_depend_on_those_beside_it(
    way: InstructionSet | None, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit: a study may group its runs as it likes. One that is not a number leaves the others as they are."""
    monkeypatch.setattr(lane_library, "worker_threads", lambda: threads)
    fixed, by_row = tables(43, 6)
    lanes = lanes_of(filter_like(), way, {"x": "x_next", "S": "S_next"})
    whole = lanes(43, 6, fixed, by_row, every=["y", "S_next"])
    for part in (slice(0, 1), slice(1, 8), slice(8, 43), slice(42, 43), slice(0, 43, 3)):
        some = {name: value[part] for name, value in fixed.items()}
        members = len(some["x"])
        alone = lanes(members, 6, some, {"u": by_row["u"][part]}, every=["y", "S_next"])
        for name in ("y", "S_next"):
            np.testing.assert_array_equal(alone[name], whole[name][part])
    fixed["x"][4], fixed["x"][17] = np.nan, np.inf
    spoilt = lanes(43, 6, fixed, by_row, every=["y"])["y"]
    others = np.setdiff1d(np.arange(43), [4, 17])
    assert np.isnan(spoilt[4, :, 0]).all() and np.isnan(spoilt[17, :, 0]).all()
    np.testing.assert_array_equal(spoilt[others], whole["y"][others])


@needs_compiler
def test_plain_code_gives_casadis_own_numbers() -> None:
    """With one lane nothing is approximated: the same operations in the same order."""
    fixed, by_row = tables(3, 4)
    carried = {"x": "x_next", "S": "S_next"}
    plain = lanes_of(filter_like(), SCALAR, carried)(3, 4, fixed, by_row, every=["y"])
    mapped = lanes_of(filter_like(), None, carried)(3, 4, fixed, by_row, every=["y"])
    np.testing.assert_array_equal(plain["y"], mapped["y"])


# -- what can not be done ----------------------------------------------------------------------------------------------


def test_without_a_compiler_the_map_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    fixed, by_row = tables(3, 4)
    carried = {"x": "x_next", "S": "S_next"}
    with pytest.warns(CompileWarning, match="filter_like is not compiled: no C compiler found"):
        lanes = Lanes(filter_like(), carried, as_machine_code=True)
    expected = Lanes(filter_like(), carried)(3, 4, fixed, by_row, every=["y"])["y"]
    np.testing.assert_array_equal(lanes(3, 4, fixed, by_row, every=["y"])["y"], expected)


@needs_compiler
def test_instructions_that_the_compiler_does_not_know_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    strange = InstructionSet("strange", 4, ("-march=no-such-machine",))
    monkeypatch.setattr(lane_library, "supported", lambda: (strange, SCALAR))
    library = lane_library.LaneLibrary(Lanes(filter_like(), {}).function, [-1, -1, -1, -1])
    assert library.instructions is SCALAR
    monkeypatch.setattr(lane_library, "supported", lambda: (strange,))
    with pytest.raises(CompileError, match="failed on filter_like_lanes"):
        lane_library.LaneLibrary(Lanes(filter_like(), {}).function, [-1, -1, -1, -1])


def test_wrong_arguments_are_named() -> None:
    lanes = Lanes(filter_like(), {"x": "x_next"})
    fixed, by_row = tables(3, 4)
    with pytest.raises(ModelError, match="'p' is not given"):
        lanes(3, 4, {"x": fixed["x"], "S": fixed["S"]}, by_row, every=["y"])
    with pytest.raises(ModelError, match=r"'u' has the shape \(3, 4, 2\); give \(5, 2\), or .*\(3, 5, 2\)"):
        lanes(3, 5, fixed, by_row, every=["y"])
    with pytest.raises(ModelError, match="no 'z' to carry"):
        Lanes(filter_like(), {"z": "x_next"})


def test_a_result_of_another_shape_can_not_be_carried() -> None:
    x = ca.SX.sym("x", 3)
    function = ca.Function("sums", [x], [ca.sum1(x)], ["x"], ["s"])
    with pytest.raises(ModelError, match=r"'s' .1, 1. can not take the place of 'x' .3, 1."):
        Lanes(function, {"x": "s"})
