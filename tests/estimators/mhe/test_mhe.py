"""Moving horizon: the Kalman filter on a linear model, the batch fit with a full window, one answer of two solvers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from estimators.ekf import Ekf
from estimators.mhe.estimator import Mhe
from estimators.pem import Pem
from tests.estimators import toys
from tests.estimators.conftest import CellCase, replay
from tests.estimators.gaussian import linear_record, run_estimator


@pytest.mark.parametrize(("window_s", "every_s", "state_noise"), [(5, 1, 0.0), (5, 1, 0.3), (8, 4, 0.1), (40, 1, 0.1)])
def test_on_a_linear_model_any_window_is_the_kalman_filter(window_s: float, every_s: float, state_noise: float) -> None:
    """The arrival cost holds all that is older, exactly; with missing samples and two rates of measurement."""
    record = linear_record(4)
    common = {"drift_per_hour": 4.0, "state_noise": state_noise, "outlier_std": np.inf}
    mhe = Mhe(record.setup, window_s=window_s, solve_every_s=every_s, **common)  # type: ignore[arg-type]
    expected = run_estimator(Ekf(record.setup, **common), record)  # type: ignore[arg-type]
    for a, b in zip(run_estimator(mhe, record), expected, strict=True):
        for name in ("parameters", "state", "covariance", "prediction", "innovation_std"):
            np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-5, atol=1e-6, err_msg=name)
        assert a.status is b.status


@pytest.mark.parametrize("solver", ["ipopt", "fatrop"])
def test_with_a_full_window_and_constant_parameters_it_is_the_batch_fit(solver: str) -> None:
    """A model that is not linear in its parameters, from a guess that is far off."""
    generator = np.random.default_rng(3)
    model = toys.decay()
    data = toys.record(
        model, generator.normal(size=50), parameters={"a": 0.3, "b": 1.4}, noise=0.02 * generator.normal(size=(50, 1))
    )
    setup = Setup(model, 1.0, ("a", "b"), ("y",))
    fit = Pem(setup, initial_state="given").fit(data)
    far = np.array([0.8, 0.6])
    prior = Prior(0.0, np.zeros(1), far, np.diag(far**2 * 1e6), fit.noise_std)
    mhe = Mhe(setup, window_s=60, solve_every_s=49, drift_per_hour=0.0, outlier_std=np.inf, solver=solver)
    state = mhe.init(prior)
    for k in range(1, 50):
        state, estimate = mhe.update(state, Sample(float(k), data.inputs[k], data.outputs[k]))
    assert estimate.status is Status.OK
    np.testing.assert_allclose(estimate.parameters, fit.values(), rtol=1e-5)
    np.testing.assert_allclose(estimate.covariance, fit.covariance, rtol=1e-3)
    np.testing.assert_allclose(estimate.state, fit.last_state, atol=1e-5)


def test_two_solvers_with_two_hessians_agree_on_the_cell(cell_case: CellCase) -> None:
    options = {"window_s": 10.0, "solve_every_s": 5.0, "drift_per_hour": 0.5}
    samples = cell_case.samples[:25]
    estimates = [
        replay(Mhe(cell_case.setup, solver=name, **options), cell_case.prior, samples) for name in ("ipopt", "fatrop")
    ]
    for a, b in zip(*estimates, strict=True):
        assert a.status is b.status is Status.OK
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-6)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-4)


def test_the_window_is_held_within_bounds_that_a_kalman_step_would_leave() -> None:
    """A true b beyond its bound: the whole window is fitted with b on it, and a takes what it can."""
    model = toys.decay()
    limited = replace(model.parameters[1], upper=1.2)
    model = replace(model, parameters=(model.parameters[0], limited))
    u = np.ones(40)
    data = toys.record(toys.decay(), u, parameters={"a": 0.4, "b": 2.0})
    setup = Setup(model, 1.0, ("a", "b"), ("y",))
    prior = Prior(0.0, np.zeros(1), np.array([0.4, 1.0]), np.diag([0.04, 0.04]), np.array([0.1]))
    mhe = Mhe(setup, window_s=20, solve_every_s=2, drift_per_hour=0.0, outlier_std=np.inf)
    samples = tuple(Sample(float(k), data.inputs[k], data.outputs[k]) for k in range(1, 40))
    last = replay(mhe, prior, samples)[-1]
    assert last.parameters[1] == pytest.approx(1.2, abs=1e-3)
    # steady y = b / a = 5, so with b on its bound a goes to 1.2 / 5
    assert last.parameters[0] == pytest.approx(0.24, rel=0.05)


@pytest.mark.parametrize("options", [{"solver": "snopt"}, {"window_s": 0.0}, {"outlier_std": -1.0}])
def test_an_option_out_of_range_is_a_named_error(options: dict[str, object]) -> None:
    with pytest.raises(ModelError, match="mhe"):
        Mhe(linear_record(1).setup, **options)  # type: ignore[arg-type]
