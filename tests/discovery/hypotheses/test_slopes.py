"""Protects: the derivatives along a run are those of the run itself, by every unknown of a joint fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.hypotheses.joint import fit as joint
from adaptive_flot.discovery.hypotheses.joint.fit import JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import Constants
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.hypotheses.tank import DRAUGHT, NOISE, ROWS, record, tank

LAG = Effect("thermometer", "lag", "lag", {"amplitude": 1.0, "time_constant": 120.0}, {"scale": 10.0})
TOGETHER = np.array([[0.05, 0.0], [3.0, 2.0]])
"""Root of a covariance: both constants move with the first unknown."""
NEAR = 2e-3
"""What differences over 1e-4 of a scale leave of the curvature."""


def fitter_of(effects: Sequence[Effect], coefficients: tuple[str, ...], ratios: frozenset[str]) -> JointFitter:
    """Two records, one with values that nobody measured and rows that do not count; constants known together."""
    records = record("first", 1, DRAUGHT), record("second", 2, start=330.0)
    records[0].outputs[100:120] = np.nan
    counted = np.ones(ROWS, dtype=bool), np.arange(ROWS) % 50 > 10
    rows = Rows(records, (0,), (np.full((ROWS, 1), NOISE), np.full((ROWS, 1), 2 * NOISE)), counted)
    constants = Constants(("efficiency", "loss"), np.array([0.85, 70.0]), TOGETHER, ratios)
    return JointFitter(tank().with_effects(effects), rows, constants, coefficients)


@given(
    seed=st.integers(0, 1000),
    which=st.sampled_from(
        [(DRAUGHT, ("heat_loss_by_constant.amplitude",)), (LAG, ("thermometer_by_lag.time_constant",))]
    ),
    ratios=st.sampled_from([frozenset[str](), frozenset({"loss"}), frozenset({"efficiency", "loss"})]),
)
def test_exact_derivatives_are_those_of_differences(
    seed: int, which: tuple[Effect, tuple[str, ...]], ratios: frozenset[str]
) -> None:
    effect, names = which
    fitter = fitter_of([effect], names, ratios)
    z = fitter.unknowns.start()
    z += 0.3 * np.random.default_rng(seed).normal(size=len(z))
    z = fitter.unknowns.inside(z)
    exact, differences = fitter.jacobian(z), fitter.differences(z, fitter.errors(z), len(z))
    assert exact.shape == differences.shape == (2 * ROWS + 2 + 2 * fitter.unknowns.nx, len(z))
    assert not exact[100:120].any()  # nothing was measured there
    assert not exact[:ROWS, -fitter.unknowns.nx :].any()  # the first record does not see where the second starts
    size = np.linalg.norm(differences, axis=0)
    assert (size > 0).all() and (np.linalg.norm(exact - differences, axis=0) < NEAR * size).all()


def test_a_constant_at_its_bound_moves_to_the_side_that_has_room() -> None:
    fitter = fitter_of([], (), frozenset())
    z = fitter.unknowns.start()
    z[:2] = np.linalg.solve(TOGETHER, [1.5 - 0.85, 0.0])  # the largest efficiency
    assert fitter.unknowns.parameters(z)[0] == pytest.approx(1.5)
    exact, differences = fitter.jacobian(z), fitter.differences(z, fitter.errors(z), len(z))
    size = np.linalg.norm(differences, axis=0)
    assert (np.linalg.norm(exact - differences, axis=0) < NEAR * size).all() and size[0] > 1.0


def test_without_a_compiler_they_are_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    """A function for exact ones takes longer to make there than a fit."""
    fitter = fitter_of([], (), frozenset())
    z = fitter.unknowns.start()
    monkeypatch.setattr(RecordSimulator, "has_quick_slopes", lambda *given: False)
    assert np.array_equal(fitter.jacobian(z), fitter.differences(z, fitter.errors(z), len(z)))


def test_of_the_coefficients_alone_they_are_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    """For one unknown two runs are quicker than one with derivatives."""
    fitter = fitter_of([DRAUGHT], ("heat_loss_by_constant.amplitude",), frozenset())
    monkeypatch.setattr(joint, "exact_slopes", lambda *given: pytest.fail("asked for all unknowns"))
    z = fitter.unknowns.start()
    assert fitter.jacobian(z, 1).shape == (2 * ROWS + len(z) - 1, 1)
