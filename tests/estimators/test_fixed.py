"""The fixed estimator is a free run of the model."""

from __future__ import annotations

import numpy as np

from adaptive_flot.contracts import Status
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.fixed import Fixed
from tests.estimators.conftest import CellCase, full, replay


def test_predictions_are_the_free_run_and_nothing_is_adapted(cell_case: CellCase, fast: Stepper) -> None:
    estimates = replay(Fixed(cell_case.setup), cell_case.prior, cell_case.samples)
    free = fast.simulate(cell_case.x0, cell_case.inputs, full(cell_case.setup, cell_case.prior.parameters))
    np.testing.assert_allclose([e.prediction for e in estimates], free.outputs, rtol=1e-12)
    np.testing.assert_allclose([e.state for e in estimates], free.states, rtol=1e-12)
    for e, sample in zip(estimates, cell_case.samples, strict=True):
        np.testing.assert_array_equal(e.parameters, cell_case.prior.parameters)
        np.testing.assert_array_equal(e.innovation, sample.outputs - e.prediction)
        assert not e.covariance.any() and e.status is Status.OK and e.time == sample.time


def test_a_setup_prints_as_one_short_line(cell_case: CellCase) -> None:
    """An estimator of one's own that fails shows what it was built for, not the whole model."""
    assert repr(cell_case.setup) == (
        "<Setup model: flotation; dt: 1 s; parameters: growth_exponent, coalescence_rate; outputs: concentrate_grade>"
    )
