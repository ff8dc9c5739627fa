"""Protects: an interval of a size since a reference is never narrower than the noise of the record allows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from adaptive_flot.discovery.hypotheses import cross_validation
from adaptive_flot.discovery.hypotheses.joint.fit import JointFitter
from adaptive_flot.discovery.hypotheses.joint.known_before import loose_constants
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.greybox.effects import Effect
from tests.discovery.hypotheses.tank import NOISE, ROWS, record, tank

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
