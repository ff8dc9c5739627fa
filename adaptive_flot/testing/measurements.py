"""Checks of what is measured: missing, at several rates, delayed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import DelayedValue, Sample, Status
from adaptive_flot.contracts.delayed_measurements import taking_delayed_values
from adaptive_flot.testing.cases import EstimatorCase, run_estimator
from adaptive_flot.testing.comparing import same


def check_missing_measurement_is_a_status(case: EstimatorCase) -> None:
    """Without a measurement the estimator predicts only, says so, and goes on with the next sample."""
    state, _ = case.estimator.update(case.estimator.init(case.prior), case.samples[0])
    missing = replace(case.samples[1], outputs=np.full_like(case.samples[1].outputs, np.nan))
    after, estimate = case.estimator.update(state, missing)
    assert estimate.status is not Status.OK, "a missing measurement must give a status"
    finite = np.isfinite(estimate.prediction).all() and np.isfinite(estimate.parameters).all()
    assert finite, "without a measurement prediction and parameters must stay finite"
    assert np.isnan(estimate.innovation).all(), "there is no innovation without a measurement"
    _, following = case.estimator.update(after, case.samples[2])
    goes_on = np.isfinite(following.parameters).all() and following.status is Status.OK
    assert goes_on, "the sample after a missing one must be taken as any other"


def check_several_rates(case: EstimatorCase) -> None:
    """Each output at its own rate: innovations exactly where something was measured, a status where nothing drives."""
    setup = case.estimator.setup
    driving = setup.model.indices("outputs", setup.outputs)
    rates = 1 + 2 * np.arange(len(setup.model.outputs)) % 5
    rates[driving] = 4
    thinned = [
        replace(s, outputs=np.where((k + 1) % rates == 0, s.outputs, np.nan)) for k, s in enumerate(case.samples)
    ]
    _, estimates = run_estimator(case.estimator, case.estimator.init(case.prior), thinned)
    for k, (sample, e) in enumerate(zip(thinned, estimates, strict=True)):
        assert np.array_equal(np.isnan(e.innovation), np.isnan(sample.outputs)), f"innovations of sample {k}"
        finite = all(np.isfinite(value).all() for value in (e.parameters, e.state, e.prediction))
        assert finite, f"parameters, state or prediction of sample {k} are not finite"
        assert (e.status is Status.MISSING) == ((k + 1) % 4 != 0), f"status {e.status.name} of sample {k}"


def check_delayed_value_is_as_good_as_one_in_time(case: EstimatorCase) -> None:
    """Once a delayed value has come, estimates are those of a record in which it was there in time."""
    setup = case.estimator.setup
    output = setup.outputs[0]
    j = setup.model.index("outputs", output)
    taken, arrives = 6, 11
    delayed, in_time = list(case.samples), list(case.samples)
    outputs = case.samples[taken].outputs.copy()
    outputs[j] *= 1.01
    in_time[taken] = replace(case.samples[taken], outputs=outputs)
    delayed[taken] = _without(case.samples[taken], j)
    value = DelayedValue(output, case.samples[taken].time + 0.3 * setup.dt, float(outputs[j]))
    delayed[arrives] = replace(case.samples[arrives], delayed=(value,))
    estimator = taking_delayed_values(case.estimator, 10 * setup.dt)
    _, estimates = run_estimator(estimator, estimator.init(case.prior), delayed)
    _, expected = run_estimator(case.estimator, case.estimator.init(case.prior), in_time)
    assert estimates[arrives].status is Status.DELAYED, (
        f"status {estimates[arrives].status.name} where a delayed value was used"
    )
    used = [(v.output, v.time) for v in estimates[arrives].delayed]
    assert used == [(output, case.samples[taken].time)], f"the estimate tells {used} of the delayed value"
    innovation = estimates[arrives].delayed[0].value
    assert np.isclose(innovation, expected[taken].innovation[j], rtol=1e-6), (
        "the innovation of the delayed value is off"
    )
    for a, b in zip(estimates[arrives:], expected[arrives:], strict=True):
        for x, y in ((a.parameters, b.parameters), (a.state, b.state), (a.prediction, b.prediction)):
            assert np.allclose(x, y, rtol=1e-6), "the estimate differs from the one with the value in time"
        alike = np.allclose(a.covariance, b.covariance, rtol=1e-4, atol=1e-18)
        assert alike, "the covariance differs from the one with the value in time"


def check_delayed_value_without_a_sample_is_a_status(case: EstimatorCase) -> None:
    """A delayed value from before the start, from the future or without a time is refused and changes nothing."""
    estimator = taking_delayed_values(case.estimator, 10 * case.estimator.setup.dt)
    output = case.estimator.setup.outputs[0]
    _, expected = run_estimator(estimator, estimator.init(case.prior), case.samples)
    for time in (-1e4, case.samples[5].time + 100.0, float("nan")):
        samples = list(case.samples)
        samples[5] = replace(samples[5], delayed=(DelayedValue(output, time, 0.5),))
        _, estimates = run_estimator(estimator, estimator.init(case.prior), samples)
        assert estimates[5].status is Status.TOO_OLD and estimates[5].delayed == (), (
            f"a delayed value of time {time} was taken"
        )
        unchanged = same(estimates[5].parameters, expected[5].parameters) and same(estimates[6:], expected[6:])
        assert unchanged, f"a refused value of time {time} changed the estimates"


def _without(sample: Sample, j: int) -> Sample:
    outputs = sample.outputs.copy()
    outputs[j] = np.nan
    return replace(sample, outputs=outputs)


MEASUREMENT_CHECKS: tuple[Callable[[EstimatorCase], None], ...] = (
    check_missing_measurement_is_a_status,
    check_several_rates,
    check_delayed_value_is_as_good_as_one_in_time,
    check_delayed_value_without_a_sample_is_a_status,
)
