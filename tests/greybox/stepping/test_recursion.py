"""A recursion is the Python loop over its function, rows and carried matrices in their places."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.stepping.fastcall import FastCall
from adaptive_flot.greybox.stepping.recursion import Recursion

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
