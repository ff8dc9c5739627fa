"""The froth closures: the branches as printed, met away from alpha* = 0.5 and smoothly joined there."""

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from adaptive_flot.processes.flotation import froth

VG, SETTLING, D_INT, D_FROTH, DEPTH, AXIAL, AREA, K1, BORDER = 8e-3, 6.5e-4, 6e-4, 8e-3, 0.1, 5e-5, 0.18, 5e4, 6.815
Closure = Callable[[float], float]


def closures() -> dict[str, tuple[Callable[[ca.SX], ca.SX], Closure, Closure]]:
    """Each closure of alpha*: as implemented, and both branches as printed."""
    size, drop, flow = (
        (D_INT / D_FROTH) ** 0.5,
        SETTLING**1.5 * DEPTH / AXIAL,
        BORDER * AREA * VG**2 / (K1 * D_FROTH**2),
    )
    vg, settling, d_int, d_froth, depth, axial, area, k1, border = (
        ca.SX(v) for v in (VG, SETTLING, D_INT, D_FROTH, DEPTH, AXIAL, AREA, K1, BORDER)
    )
    return {
        "R_f": (
            lambda a: froth.froth_recovery(a, vg, settling, d_int, d_froth),
            lambda a: (a * (1 - a) * VG / SETTLING) ** 0.25 * size,
            lambda a: (VG / (4 * SETTLING)) ** 0.25 * size,
        ),
        "R_ent": (
            lambda a: froth.entrainment(a, vg, settling, depth, axial),
            lambda a: float(np.exp(-drop / np.sqrt(VG * (1 - a)))),
            lambda a: float(np.exp(-2 * drop / np.sqrt(VG))),
        ),
        "Q_conc": (
            lambda a: froth.concentrate_flow(a, vg, area, k1, d_froth, border),
            lambda a: flow * (1 - a) * a,
            lambda a: flow / 4,
        ),
    }


def compiled(closure: Callable[[ca.SX], ca.SX]) -> Callable[[float], tuple[float, float]]:
    """Value and slope of a closure at an alpha*."""
    a = ca.SX.sym("a")
    call = FastCall(ca.Function("closure", [a], [closure(a), ca.jacobian(closure(a), a)]))

    def at(alpha: float) -> tuple[float, float]:
        value, slope = call(alpha)
        return float(value.item()), float(slope.item())

    return at


@pytest.mark.parametrize("name", ["R_f", "R_ent", "Q_conc"])
@pytest.mark.parametrize(
    ("low", "high", "branch", "tolerance"),
    [(0.08, 0.21, 0, 1e-6), (0.08, 0.4, 0, 5e-3), (0.6, 0.95, 1, 5e-3), (0.79, 0.95, 1, 1e-6)],
    ids=["range of the paper", "below 0.4", "above 0.6", "well above"],
)
def test_printed_branch_is_met(name: str, low: float, high: float, branch: int, tolerance: float) -> None:
    """To 1e-6 in the paper's range of alpha*, to the weight of the logistic, 0.7 %, up to 0.1 from the switch."""
    implemented, *printed = closures()[name]
    at = compiled(implemented)
    for a in np.linspace(low, high, 14):
        assert at(float(a))[0] == pytest.approx(printed[branch](float(a)), rel=tolerance)


@pytest.mark.parametrize("name", ["R_f", "R_ent", "Q_conc"])
def test_closures_are_smooth_across_the_switch(name: str) -> None:
    """Finite, no jump in value or slope, and between the branches: an optimiser may walk through."""
    implemented, *printed = closures()[name]
    at = compiled(implemented)
    grid = np.linspace(0.4, 0.6, 401)
    values, slopes = np.array([at(float(a)) for a in grid]).T
    assert np.isfinite(values).all()
    assert np.isfinite(slopes).all()
    assert np.max(np.abs(np.diff(values))) < 0.02 * np.max(values)
    assert np.max(np.abs(np.diff(slopes))) < 0.1 * np.max(np.abs(slopes))
    np.testing.assert_allclose(np.gradient(values, grid)[1:-1], slopes[1:-1], atol=5e-3 * np.max(np.abs(slopes)))
    both = np.array([[branch(float(a)) for branch in printed] for a in grid])
    slack = 1e-12 * np.max(values)
    assert np.all((values >= both.min(axis=1) - slack) & (values <= both.max(axis=1) + slack))
