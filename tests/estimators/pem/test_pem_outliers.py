"""Outliers in a record move neither the fit nor its covariance, and do not look like an error of the model."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.trust import NOT_WHITE
from estimators.pem import Pem
from tests.estimators import toys
from tests.estimators.pem.test_pem_linear import make_record
from tests.estimators.pem.test_pem_linear import ordinary as least_squares

MODEL = toys.linear(2)
ROWS, NOISE = 600, 0.3


def fit(record: Dataset) -> BatchFit:
    return Pem(Setup(MODEL, 1.0, MODEL.names("parameters"), MODEL.names("outputs"))).fit(record)


def contaminated(record: Dataset, seed: int, slow: FloatArray | float = 0.0) -> tuple[Dataset, NDArray[np.bool_]]:
    """The record with one value in twenty off by 6, up or down, and which."""
    wrong = np.arange(ROWS) % 20 == 7
    added = wrong * np.random.default_rng(1000 + seed).choice([-6.0, 6.0], ROWS) + slow
    return toys.measured_as(record, record.outputs + added[:, None]), wrong


@pytest.mark.parametrize("seed", range(4))
def test_the_fit_is_that_of_least_squares_without_the_outliers(seed: int) -> None:
    record, wrong = contaminated(make_record(seed, 2, rows=ROWS, noise=(NOISE,)), seed)
    theta, covariance, noise = least_squares(record.inputs[~wrong], record.outputs[~wrong, 0])
    found = fit(record)
    np.testing.assert_allclose(found.values(), theta, atol=0.7 * float(np.sqrt(covariance[0, 0])))
    np.testing.assert_allclose(found.covariance, covariance, rtol=0.1, atol=0.02 * covariance[0, 0])
    assert found.core_noise_std is not None and found.core_noise_std[0] == pytest.approx(noise, rel=0.05)
    assert found.noise_std[0] == pytest.approx(np.hypot(noise, 6.0 * np.sqrt(0.05)), rel=0.05)
    assert found.colour is not None and found.colour[0] < NOT_WHITE


def test_outliers_do_not_hide_that_the_model_is_wrong() -> None:
    record, _ = contaminated(make_record(2, 2, rows=ROWS, noise=(NOISE,)), 2, np.sin(np.arange(ROWS) / 20))
    found = fit(record)
    assert found.colour is not None and found.colour[0] > 2 * NOT_WHITE


def test_without_outliers_there_is_one_noise_level() -> None:
    record = make_record(2, 2, rows=ROWS, noise=(NOISE,))
    found = fit(record)
    np.testing.assert_allclose(found.noise_std, least_squares(record.inputs, record.outputs[:, 0])[2], rtol=1e-8)
    assert found.core_noise_std is None
