"""FastCall: the same numbers as CasADi, fresh results, clear errors."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall


def _function() -> ca.Function:
    # a matrix argument, and a sparse matrix result whose transpose differs from it
    x, m = ca.SX.sym("x", 2), ca.SX.sym("m", 2, 3)
    sparse = ca.jacobian(ca.vertcat(x[0] * x[1], x[1] ** 2, ca.sin(x[1])), x)
    return ca.Function("f", [x, m], [ca.mtimes(m.T, x), sparse, x[0] * m], ["x", "m"], ["v", "J", "M"])


numbers = st.floats(-10, 10)


@given(arrays(float, 2, elements=numbers), arrays(float, (2, 3), elements=numbers))
def test_results_are_those_of_numpy(x: FloatArray, m: FloatArray) -> None:
    """Vectors come back as (n,), matrices as (n, m) and not transposed, structural zeros included."""
    vector, jacobian, matrix = FastCall(_function())(x, m)
    np.testing.assert_allclose(vector, m.T @ x, rtol=1e-14, atol=1e-12)
    np.testing.assert_allclose(jacobian, [[x[1], x[0]], [0, 2 * x[1]], [0, np.cos(x[1])]], rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(matrix, x[0] * m, rtol=1e-14, atol=1e-14)


def test_memory_order_and_strides_of_an_argument_do_not_matter() -> None:
    call, x = FastCall(_function()), np.array([2.0, 3.0])
    m = np.arange(6.0).reshape(2, 3)
    strided = np.repeat(m, 2, axis=1)[:, ::2]
    for same in (np.asfortranarray(m), strided):
        np.testing.assert_array_equal(call(x, same)[0], m.T @ x)


def test_results_stay_as_they_were_when_the_next_call_comes() -> None:
    """An estimator may keep a result without a copy; and no argument is written to."""
    call = FastCall(_function())
    x, m = np.array([2.0, 3.0]), np.ones((2, 3))
    first = call(x, m)
    kept = [r.copy() for r in first]
    call(np.array([-1.0, 5.0]), 7 * m)
    for result, copy in zip(first, kept, strict=True):
        np.testing.assert_array_equal(result, copy)
    np.testing.assert_array_equal(x, [2.0, 3.0])
    np.testing.assert_array_equal(m, np.ones((2, 3)))


def test_single_sparse_result_is_dense() -> None:
    """A function with one result takes another path in CasADi's Python call."""
    x = ca.SX.sym("x", 2)
    (result,) = FastCall(ca.Function("g", [x], [ca.diag(x)]))([4.0, 5.0])  # type: ignore[arg-type]
    np.testing.assert_array_equal(result, [[4.0, 0.0], [0.0, 5.0]])


def test_arguments_without_elements_are_taken() -> None:
    """A model without algebraic variables has an empty z."""
    x, z = ca.SX.sym("x"), ca.SX.sym("z", 0)
    (result,) = FastCall(ca.Function("h", [x, z], [2 * x]))(3.0, np.empty(0))
    np.testing.assert_array_equal(result, [6.0])


def test_nan_passes_through() -> None:
    """Numbers fail as values, never as exceptions."""
    vector, *_ = FastCall(_function())(np.array([np.nan, 1.0]), np.ones((2, 3)))
    assert np.isnan(vector).all()


def test_transposed_matrix_is_refused() -> None:
    """It has the right number of elements, in the wrong order."""
    with pytest.raises(ModelError, match=r"'m' has the shape \(3, 2\), the model takes \(2, 3\)"):
        FastCall(_function())(np.ones(2), np.ones((3, 2)))


def test_wrong_number_of_arguments_is_named() -> None:
    with pytest.raises(ModelError, match="f: 1 arguments given, 2 taken"):
        FastCall(_function())(np.ones(2))


@pytest.mark.parametrize("size", [1, 3])
def test_wrong_shape_of_an_argument_is_named(size: int) -> None:
    """In particular one element is not spread over the vector, as CasADi itself would do."""
    with pytest.raises(ModelError, match=rf"'x' has the shape \({size},\), the model takes \(2,\)"):
        FastCall(_function())(np.ones(size), np.ones((2, 3)))


@pytest.mark.parametrize("size", [0, 2])
def test_no_value_and_several_are_no_number(size: int) -> None:
    """An argument of one number takes a number, or an array of one."""
    t = ca.SX.sym("t")
    call = FastCall(ca.Function("f", [t], [2 * t], ["t"], ["y"]))
    assert call(1.5)[0].tolist() == call(np.array([1.5]))[0].tolist() == [3.0]
    with pytest.raises(ModelError, match=rf"'t' has the shape \({size},\), the model takes \(1,\)"):
        call(np.ones(size))
