"""A model that does not explain its first record: where the filter starts, and what it says during the run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm import AdaptiveImm
from estimators.adaptive_imm.bank import Triangles
from estimators.adaptive_imm.trust import Trust
from estimators.pem import Pem
from tests.estimators import toys
from tests.estimators.adaptive_imm.test_adaptive_imm import regression
from tests.estimators.conftest import CellCase, replay
from tests.estimators.gaussian import run_estimator

WHERE = slice(1, 3)


def start(trust: Trust, away: float, std: float) -> tuple[FloatArray, FloatArray]:
    """One state that hangs on the first of two coordinates; nominal values 0 +- 0.5."""
    P = np.diag([0.0, std**2, std**2])
    P[0, 0], P[0, 1], P[1, 0] = 4 * std**2, 2 * std**2, 2 * std**2
    z = np.array([7.0, away, 0.0])
    return trust.start(z, P, WHERE, np.zeros(2), np.array([0.5, 0.5]))


def test_errors_that_are_white_leave_a_fit_where_it_is_however_far_from_nominal() -> None:
    trust = Trust.of(np.array([1.2, np.nan]), doubts=True)
    assert trust == Trust(1.0, 0.0) == Trust.of(None, doubts=True)
    z, P = start(trust, 3.0, 0.01)
    assert z[1] == pytest.approx(3.0, rel=1e-3)
    assert P[1, 1] == pytest.approx(1e-4, rel=1e-3)


def test_errors_that_are_not_white_make_a_far_fit_give_way_to_the_nominal_values() -> None:
    """The steps by hand: inflate by the colour, then by Birge's ratio, then take the nominal values as measured."""
    trust = Trust.of(np.array([40.0]), doubts=True)
    z, P = start(trust, 3.0, 0.01)
    inflated = 40.0 * 1e-4
    ratio = (3.0**2 / (inflated + 0.25)) / 2
    wide = inflated * (1 + (1 - 1 / 40) * (ratio - 1))
    gain = wide / (wide + 0.25)
    np.testing.assert_allclose(z, [7.0 - 2 * gain * 3.0, 3.0 * (1 - gain), 0.0])
    assert P[1, 1] == pytest.approx(wide * (1 - gain))
    assert np.linalg.eigvalsh(P).min() >= -1e-12


def test_without_discrepancies_nothing_is_ruled_out() -> None:
    assert Trust.of(np.array([40.0]), doubts=False).doubt == 0.0


def test_a_first_record_with_slow_errors_is_told_from_the_first_sample(cell_case: CellCase) -> None:
    estimator, samples = AdaptiveImm(cell_case.setup), cell_case.samples[:20]
    right = replay(estimator, cell_case.prior, samples)
    wrong = replay(estimator, replace(cell_case.prior, colour=np.array([30.0])), samples)
    assert {e.status for e in right} == {Status.OK} and {e.status for e in wrong} == {Status.MODEL_ERROR}
    assert np.linalg.det(wrong[-1].covariance) > 4 * np.linalg.det(right[-1].covariance)


def test_the_reference_widens_the_region_and_leaves_the_estimate(cell_case: CellCase) -> None:
    def run(share: float) -> list[Estimate]:
        return replay(AdaptiveImm(cell_case.setup, reference_share=share), cell_case.prior, cell_case.samples[:60])

    none, some = run(0.0), run(0.25)
    for a, b in zip(none, some, strict=True):
        np.testing.assert_allclose(a.parameters, b.parameters, rtol=1e-9)
        np.testing.assert_allclose(a.prediction, b.prediction, rtol=1e-9)
    wider = some[-1].covariance - 0.74 * none[-1].covariance
    assert np.linalg.eigvalsh(wider).min() > 0 and np.linalg.det(some[-1].covariance) > np.linalg.det(
        none[-1].covariance
    )


def test_a_batch_fit_tells_the_colour_of_its_errors() -> None:
    """Y = th u, and an offset that comes and goes slowly: the prior of the fit says so."""
    generator, rows = np.random.default_rng(6), 400
    inputs = generator.normal(size=rows)
    noise = 0.1 * generator.normal(size=rows)
    slow = 0.3 * np.sin(np.arange(rows) / 30.0)
    model = toys.linear(1, value=1.0)
    setup = Setup(model, 1.0, model.names("parameters"), model.names("outputs"))
    found = []
    for outputs in (inputs + noise, inputs + noise + slow):
        record = toys.measured_as(toys.record(model, inputs[:, None]), outputs[:, None])
        colour = Pem(setup).fit(record).prior(0.0).colour
        assert colour is not None
        found.append(colour[0])
    assert found[0] < 2.0 < 5.0 < found[1]


def test_a_disturbance_that_nobody_measures_is_kept_from_the_parameters() -> None:
    """Y = th0 u0 + th1 u1 where th1 steps, th0 does not, and only th0 is adapted."""
    generator, rows = np.random.default_rng(7), 300
    model = toys.linear(2, value=1.0)
    inputs = generator.normal(size=(rows, 2))
    step = np.where(np.arange(rows) < 100, 1.0, 1.3)
    outputs = inputs[:, 0] + step * inputs[:, 1] + 0.01 * generator.normal(size=rows)
    samples = tuple(Sample(k + 1.0, u, np.array([y])) for k, (u, y) in enumerate(zip(inputs, outputs, strict=True)))
    prior = Prior(0.0, np.zeros(1), np.ones(1), 1e-4 * np.eye(1), np.array([0.01]))
    setup = Setup(model, 1.0, ("th0",), ("y0",), unmeasured=("th1",))
    record = regression(1, outputs, inputs[:, :1], 0.01)
    estimator = AdaptiveImm(setup)
    last = run_estimator(estimator, replace(record, setup=setup, prior=prior, samples=samples))[-1]
    assert last.parameters.shape == (1,) and last.covariance.shape == (1, 1)
    assert last.parameters[0] == pytest.approx(1.0, abs=0.01)
    assert last.disturbances == {"th1": pytest.approx(1.3, abs=0.01)}

    def again(start: Prior) -> Estimate:
        return estimator.update(estimator.init(start), replace(samples[-1], time=last.time + 1.0))[1]

    after, forgotten = again(prior.at(last)), again(replace(prior.at(last), disturbances={}))
    assert after.disturbances["th1"] == pytest.approx(1.3, abs=0.01) and after.disturbance_std["th1"] < 0.05
    assert abs(forgotten.disturbances["th1"] - 1.3) > 0.1
    shown = last.shown_with(samples[-1], model)
    assert shown.parameters is not None and shown.parameters[1] == last.disturbances["th1"]
    assert samples[-1].parameters is None


def test_outliers_beside_each_other_are_no_error_of_the_model(cell_case: CellCase) -> None:
    """Three values in turn off by 20 standard deviations, as happens where one in twenty is."""
    estimator, samples = AdaptiveImm(cell_case.setup), list(cell_case.samples[:60])
    column = cell_case.setup.model.index("outputs", cell_case.setup.outputs[0])
    for k in (30, 31, 32):
        outputs = samples[k].outputs.copy()
        outputs[column] += 20 * cell_case.prior.noise_std[0]
        samples[k] = replace(samples[k], outputs=outputs)
    assert {e.status for e in replay(estimator, cell_case.prior, tuple(samples))} == {Status.OK}


def test_starting_again_counts_neither_the_first_record_nor_the_nominal_values_twice(cell_case: CellCase) -> None:
    """After a gap: mean and covariance are those of the estimate, and the model is ruled out as before."""
    estimator, first = AdaptiveImm(cell_case.setup), replace(cell_case.prior, colour=np.array([30.0]))
    last = replay(estimator, first, cell_case.samples[:20])[-1]
    again = estimator.init(first.at(last))
    assert again.trust == estimator.init(first).trust and again.wrong == again.trust.doubt == 1.0
    where = estimator.layout.coordinates
    expected = estimator.coordinates.from_parameters(last.parameters)
    np.testing.assert_allclose(again.z[where, 0], expected, rtol=1e-12)
    slopes = estimator.coordinates.slopes(expected)
    shape = Triangles(len(again.z))
    P = np.zeros((len(again.z), len(again.z)))
    P[shape.rows, shape.columns] = again.P[:, list(estimator.modes.kinds).index("rest")]
    shown = again.trust.shown(np.diag(slopes) @ P[where, where] @ np.diag(slopes))
    np.testing.assert_allclose(np.tril(shown), np.tril(last.covariance), rtol=1e-6)
