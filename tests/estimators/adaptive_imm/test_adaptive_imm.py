"""Adaptive multiple-model filter: its limit is the EKF, its parts agree with plain NumPy, and what it is for."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.compiling.fastcall import FastCall
from estimators.adaptive_imm import AdaptiveImm
from estimators.adaptive_imm.bank import Contamination, Mixing, Triangles
from estimators.ekf import Ekf
from tests.estimators import toys
from tests.estimators.conftest import CellCase, replay
from tests.estimators.gaussian import LinearRecord, linear_record, run_estimator

ONE_MODE: dict[str, Any] = {
    "modes": ("walk",),
    "discrepancies": (),
    "background_per_hour": 0.0,
    "reference_share": 0.0,
    "long_run_s": 0.0,
    "outlier_share": 0.0,
    "noise_memory": 0,
    "lag_s": 0.0,
    "plausible": 1e6,
}
"""No mismatch, and one kind of change."""


def assert_same(found: list[Estimate], expected: list[Estimate]) -> None:
    for a, b in zip(found, expected, strict=True):
        for what in ("parameters", "state", "prediction", "innovation_std"):
            np.testing.assert_allclose(getattr(a, what), getattr(b, what), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-8)
        assert a.status is b.status


def test_with_one_mode_and_a_right_model_it_is_the_ekf_on_a_linear_plant() -> None:
    """Two outputs, one of them at its own rate, and a gap."""
    record = linear_record(4)
    found = run_estimator(AdaptiveImm(record.setup, **ONE_MODE, walk_per_hour=0.3), record)
    expected = run_estimator(Ekf(record.setup, drift_per_hour=0.3, outlier_std=np.inf), record)
    assert_same(found, expected)


def test_with_one_mode_and_a_right_model_it_is_the_ekf_on_the_cell(cell_case: CellCase) -> None:
    found = replay(AdaptiveImm(cell_case.setup, **ONE_MODE, walk_per_hour=0.06), cell_case.prior, cell_case.samples)
    expected = replay(Ekf(cell_case.setup, outlier_std=np.inf), cell_case.prior, cell_case.samples)
    assert_same(found, expected)


def test_mixing_is_the_conditional_mixture_summed_by_hand() -> None:
    """Three modes, the last two with a discrepancy: entry 2 is a rate, entry 3 the discrepancy."""
    generator = np.random.default_rng(2)
    n, modes = 4, 3
    halves = generator.normal(size=(modes, n, n))
    z, P, probability = generator.normal(size=(n, modes)), halves @ halves.transpose(0, 2, 1), np.array([0.5, 0.3, 0.2])
    matrix = generator.dirichlet(np.ones(modes), size=modes)
    entry, off, widths = np.zeros((modes, n)), np.array([0.0, 1.0, 1.0]), np.array([[0.0, 0.4, 0.9]])
    entry[:, 2] = [0.0, 0.7, 0.0]
    shape = Triangles(n)
    parts = ca.MX.sym("z", n, modes), ca.MX.sym("P", len(shape.rows), modes), ca.MX.sym("p", modes)
    width = ca.MX.sym("widths", 1, modes)
    mixing = Mixing(matrix, entry, slice(2, 3), slice(3, 4), off)
    mean, triangles, predicted = mixing.expressions(*parts, width)
    results = [mean, shape.whole(triangles), predicted]
    function = ca.Function("mix", [*parts, width], results, ["z", "P", "p", "w"], ["a", "b", "c"])
    call = FastCall(function, matrices=("z", "P", "w", "a", "b"))
    found, found_P, found_p = call(z, P[:, shape.rows, shape.columns].T, probability, widths)
    np.testing.assert_allclose(found_p, matrix.T @ probability, rtol=1e-12)
    for j in range(modes):
        weights = matrix[:, j] * probability / found_p[j]
        starts, spreads = z.copy(), P.copy()
        for i in range(modes):
            for k, fresh, width_of in ((2, i != j, entry[j, 2]), (3, i != j and not off[i] * off[j], widths[0, j])):
                if fresh:
                    starts[k, i], spreads[i, k, :], spreads[i, :, k] = 0.0, 0.0, 0.0
                    spreads[i, k, k] = width_of
        expected = starts @ weights
        second = sum(w * (S + np.outer(m, m)) for w, S, m in zip(weights, spreads, starts.T, strict=True))
        np.testing.assert_allclose(found[:, j], expected, rtol=1e-10)
        np.testing.assert_allclose(found_P[:, n * j : n * (j + 1)], second - np.outer(expected, expected), atol=1e-10)


@pytest.mark.parametrize("error", [0.1, 3.5, 8.0, -20.0])
def test_a_contaminated_correction_has_the_moments_of_its_mixture(error: float) -> None:
    """One state with variance 2, noise 1 or 5: the two posteriors, weighted by Bayes' rule, computed by hand."""
    share, scale, before = 0.1, 5.0, 2.0
    noises = np.array([1.0, max(scale**2, error**2 / 9)])
    spread = before + noises
    density = np.array([1 - share, share]) * np.exp(-(error**2) / spread / 2) / np.sqrt(2 * np.pi * spread)
    weights = density / density.sum()
    means, variances = before / spread * error, before - before**2 / spread
    mean = weights @ means
    one = ca.MX(1)
    done = Contamination(share, scale).correct(ca.MX.zeros(1, 1), ca.MX(before), one, ca.MX(error), one, one)
    values = [float(ca.evalf(x)) for x in (done.away, done.P, done.log_likelihood, done.believed)]
    variance = weights @ variances + weights @ (means - mean) ** 2
    # the wide component is widened beyond REACH of its own prediction, which the state's variance enters a little
    np.testing.assert_allclose(values, [mean, variance, np.log(density.sum()), weights[0]], rtol=1e-9)


def regression(rows: int, outputs: FloatArray, inputs: FloatArray, noise: float, start: float = 1.0) -> LinearRecord:
    """Y = th u with the nominal value 1 of th."""
    model = toys.linear(1, value=1.0)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    samples = tuple(Sample(k + 1.0, inputs[k : k + 1], outputs[k : k + 1]) for k in range(rows))
    prior = Prior(0.0, np.zeros(1), np.array([start]), 1e-4 * np.eye(1), np.array([noise]))
    return LinearRecord(setup, prior, samples)


@pytest.mark.parametrize("told", [0.5, 2.0])
def test_the_noise_level_is_found_though_the_prior_is_wrong_and_values_are_absurd(told: float) -> None:
    """Noise of 0.1, told as half or twice of it; one value in twenty is off by 3."""
    generator, rows = np.random.default_rng(8), 2000
    inputs = generator.normal(size=rows)
    outputs = inputs + 0.1 * generator.normal(size=rows) + 3.0 * (generator.random(rows) < 0.05)
    record = regression(rows, outputs, inputs, 0.1 * told)
    estimator = AdaptiveImm(record.setup)
    state = estimator.init(record.prior)
    for sample in record.samples:
        state, estimate = estimator.update(state, sample)
    assert np.sqrt(state.noise.variance[0]) == pytest.approx(0.1, rel=0.15)
    assert abs(estimate.parameters[0] - 1.0) < 3 * np.sqrt(estimate.covariance[0, 0]) < 0.1


def test_an_error_of_the_model_is_told_and_kept_from_the_parameters() -> None:
    """From row 300 on the output is off by what no parameter explains; before, the model is right."""
    generator, rows, noise = np.random.default_rng(3), 700, 0.01
    inputs = generator.normal(size=rows)
    off = 0.2 * np.sin(np.arange(rows) / 60.0) * (np.arange(rows) >= 300)
    record = regression(rows, inputs + off + noise * generator.normal(size=rows), inputs, noise)
    estimates = run_estimator(AdaptiveImm(record.setup), record)
    wrong = np.array([e.status is Status.MODEL_ERROR for e in estimates])
    assert wrong[:300].mean() < 0.01 and wrong[330:].mean() > 0.9
    found = np.array([e.discrepancy for e in estimates])[:, 0]
    assert np.sqrt(np.mean((found - off)[400:] ** 2)) < 0.1 * 0.2
    theta = np.array([e.parameters[0] for e in estimates])
    assert np.abs(theta - 1.0)[300:].max() < 0.02


def test_a_parameter_that_goes_where_it_can_not_be_is_told() -> None:
    """The best fit is three times the nominal value: a status, while the fit is perfect."""
    generator, rows = np.random.default_rng(3), 200
    inputs = generator.normal(size=rows)
    record = regression(rows, 3.0 * inputs + 0.01 * generator.normal(size=rows), inputs, 0.01, 3.0)
    estimates = run_estimator(AdaptiveImm(record.setup), record)
    assert estimates[-1].status is Status.MODEL_ERROR and estimates[-1].parameters[0] == pytest.approx(3.0, abs=0.05)


def test_a_direction_that_the_record_does_not_show_stays_open() -> None:
    """Y = a b u says nothing along a b = 1: linearised at each estimate a filter learns there.

    The start is not symmetric in a and b, or the direction would not turn.
    """
    generator, rows = np.random.default_rng(5), 300
    model = toys.product()
    setup = Setup(model, 1.0, ("a", "b"), ("y",))
    start = np.array([0.7, 1.2])
    prior = Prior(0.0, np.zeros(1), start, 0.01 * np.eye(2), np.array([0.02]))
    samples = tuple(Sample(k + 1.0, np.ones(1), np.array([1.0 + 0.02 * generator.normal()])) for k in range(rows))
    along = start * np.array([1.0, -1.0]) / np.linalg.norm(start)
    left = {}
    for lag in (0.0, 1e6):
        options = {**ONE_MODE, "lag_s": lag, "walk_per_hour": 0.5}
        last = run_estimator(AdaptiveImm(setup, **options), LinearRecord(setup, prior, samples))[-1]
        left[lag] = along @ last.covariance @ along
    open_to = 0.01 + 0.5**2 * rows / 3600
    assert left[1e6] == pytest.approx(open_to, rel=0.01)
    assert left[0.0] < left[1e6]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"modes": ("rest", "drfit")}, "did you mean 'drift'"),
        ({"modes": ()}, "there is no mode"),
        ({"rate_per_hour": -1.0}, "rate_per_hour = -1; give 0 or a positive number"),
        ({"change_s": 0.0}, "change_s = 0; give a positive number"),
        ({"discrepancies": (3.0, 0.0)}, r"discrepancies\[1\] = 0"),
        ({"outlier_share": 1.0}, "outlier_share = 1; it must lie in"),
        ({"reference_share": -0.1}, "reference_share = -0.1; it must lie in"),
        ({"shares": (0.6, 0.3, 0.2)}, "give three that add up to 1"),
        ({"lag_s": float("nan")}, "lag_s = nan"),
    ],
)
def test_an_option_out_of_range_is_a_named_error(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ModelError, match=says) as caught:
        AdaptiveImm(linear_record(1).setup, **options)
    assert "\n" not in str(caught.value)
