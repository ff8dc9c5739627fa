"""Protects: an interval of a size since a reference is never narrower than the noise of the record allows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from adaptive_flot.discovery.hypotheses import cross_validation
from adaptive_flot.discovery.hypotheses.families import constant_change
from adaptive_flot.discovery.hypotheses.joint.fit import JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import loose_constants
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from tests.discovery.hypotheses.tank import COLDER, NOISE, ROWS, record, tank

SHOWN = Effect("thermometer", "constant", "shift", {"amplitude": 0.0}, mode="offset")
SEEDS = range(12)


def test_deviations_are_how_estimates_scatter_from_record_to_record() -> None:
    """Twelve records that differ by their noise and moves: the scatter of estimates is what one fit says, but for 40 %.

    The standard deviation of twelve scatters by a fifth itself.
    """
    model = tank().with_effects([SHOWN])
    name = model.effects[-1].parameter("amplitude")
    found, said = [], []
    for seed in SEEDS:
        data = record(f"r{seed}", seed)
        rows = Rows((data,), (0,), (np.full((ROWS, 1), NOISE),), (np.ones(ROWS, dtype=bool),))
        fitter = JointFitter(model, rows, loose_constants(tank(), ("efficiency", "loss")), (name,))
        fit = fitter.fit_from_afar(fitter.unknowns.start())
        found.append(fit.value(name))
        said.append(fitter.deviations(fit)[0])
    assert 0.6 < np.std(found, ddof=1) / np.mean(said) < 1.4


def test_folds_that_do_not_move_leave_the_deviations_of_the_fit() -> None:
    """Every fold starts where all rows have ended: an interval of no width was told with the size."""
    still: Any = SimpleNamespace(values=np.full((5, 2), [0.3, 2.0]), deviations=np.array([0.01, 0.2]))
    moved: Any = SimpleNamespace(values=still.values + np.arange(5)[:, None], deviations=still.deviations)
    spread: Any = cross_validation.Tested.spread
    assert spread.fget(still).tolist() == [0.01, 0.2]
    assert np.allclose(spread.fget(moved), np.sqrt(4 * 2.0))


def test_a_fold_is_fitted_to_the_rows_that_it_has() -> None:
    """Constants and initial states held: the coefficient is that of a search along it alone, and differs by fold.

    A search among all unknowns never found a step short enough: errors on "fresh" stretches were those of all rows.
    """
    hypothesis = constant_change(next(s for s in tank().sites if s.name == "thermometer"), 1.0)
    data = record("r", 3, COLDER)
    rows = Rows((data,), (0,), (np.full((ROWS, 1), NOISE),), (np.ones(ROWS, dtype=bool),))
    constants = loose_constants(tank(), ("efficiency", "loss"))
    fitted = cross_validation.fit_all_rows(tank(), rows, hypothesis, constants, None)
    assert fitted is not None
    tested = cross_validation.test_on_stretches(tank(), rows, fitted, hold_constants=True)
    model = cross_validation.model_with(tank(), hypothesis)
    assert len(np.unique(tested.values)) == len(tested.values)
    for value, left_out in zip(tested.values[:, 0], cross_validation.stretches(rows), strict=True):
        fitter = JointFitter(model, rows.without(left_out), constants, hypothesis.parameters, fitted.initial)
        z = fitted.fit.unknowns

        def cost(size: float, fitter: JointFitter = fitter, z: FloatArray = z) -> float:
            moved = np.concatenate([[size / fitter.unknowns.scale[0]], z[1:]])
            return fitter.cost(moved, fitter.errors(moved))

        best = minimize_scalar(cost, bounds=(value - 0.5, value + 0.5), method="bounded", options={"xatol": 1e-6}).x
        assert abs(value - best) < 1e-3
