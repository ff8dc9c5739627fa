"""The innovations form of `estimate` on a plate whose truth is known: bands that hold it, errors by horizon."""

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.greybox import Dataset, Model, Parameter, Quantity, Scope
from adaptive_flot.report.estimate.answer import troubles
from adaptive_flot.report.estimate.innovations import innovations_sentences
from adaptive_flot.runner.commands.estimate import RecordEstimate, estimate_record
from adaptive_flot.runner.commands.record_blocks import cut

DT, ROWS, CAPACITY, LOSS, NOISE = 10.0, 400, 300.0, 2.0, 0.03


def plate() -> Model:
    """One balance with a loss to a room of 20 degC."""

    def equations(m: Scope) -> None:
        m.derivative("plate", (m.input("power") - m.parameter("loss") * (m.state("plate") - 20.0)) / CAPACITY)
        m.output("thermometer", m.state("plate"))

    return Model(
        name="plate",
        states=(Quantity("plate", "degC", "", scale=3.0),),
        inputs=(Quantity("power", "W", "", -60.0, 60.0),),
        parameters=(Parameter("loss", 1.5, "W/K", "", lower=0.05, upper=30.0, scale=1.0, role="estimated"),),
        outputs=(Quantity("thermometer", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"plate": 20.0},
    )


def record(process: float, walk: float = 0.0, seed: int = 0) -> tuple[Dataset, np.ndarray, np.ndarray]:
    """A record, the true temperature and the true loss; both noises are steps a row."""
    rng = np.random.default_rng(seed)
    power, x, loss = np.repeat(rng.uniform(-40, 40, ROWS // 10), 10), np.zeros(ROWS), np.full(ROWS, LOSS)
    x[0] = 20.0
    for k in range(1, ROWS):
        loss[k] = max(loss[k - 1] + walk * rng.normal(), 0.3)
        at = 20.0 + power[k] / loss[k]
        x[k] = at + (x[k - 1] - at) * np.exp(-loss[k] * DT / CAPACITY) + process * rng.normal()
    y = x + NOISE * rng.normal(size=ROWS)
    return Dataset("plate", DT * np.arange(ROWS, dtype=float), DT, power[:, None], y[:, None]), x, loss


def estimated(data: Dataset, innovations: bool | None = None) -> RecordEstimate:
    return estimate_record(cut(data, 0.6, "plate"), plate(), estimators=("pem",), innovations=innovations)


def test_bands_of_the_smoothed_state_hold_the_truth() -> None:
    """Both noises are found, and two standard deviations hold 95 %; one row ahead leaves what no filter can tell."""
    data, truth, _ = record(0.2)
    form = estimated(data, innovations=True).innovations
    assert form is not None
    table = form.table
    held = np.abs(table["plate_degC"] - truth) <= 2 * table["plate_degC_std"]
    assert 0.88 <= held.mean() <= 0.995
    assert form.noise.process["plate"] * np.sqrt(DT) == pytest.approx(0.2, rel=0.25)
    one = next(e for e in form.errors if e.rows == 1)
    assert one.error == pytest.approx(np.hypot(0.2, 1.4 * NOISE), rel=0.25)
    assert form.estimates[0].value == pytest.approx(LOSS, abs=3 * form.estimates[0].std)


def test_errors_grow_from_one_row_ahead_to_the_free_run() -> None:
    result = estimated(record(0.2, seed=1)[0], innovations=True)
    assert result.innovations is not None
    errors = [e.error for e in result.innovations.errors]
    free = next(e.free_run for e in result.replays[0].errors if e.block == "test")
    assert errors[0] < errors[1] < 1.05 * errors[2]
    assert errors[2] == pytest.approx(free, rel=0.4)


def test_a_parameter_that_walks_is_followed_with_its_band() -> None:
    data, _, loss = record(0.01, walk=0.08, seed=2)
    form = estimated(data, innovations=True).innovations
    assert form is not None and form.noise.walk
    held = np.abs(form.table["loss_smoothed"] - loss) <= 2 * form.table["loss_smoothed_std"]
    assert held.mean() >= 0.8
    assert np.corrcoef(form.table["loss_smoothed"], loss)[0, 1] > 0.9


def test_it_is_asked_for_by_a_record_that_needs_it_and_by_no_other() -> None:
    assert estimated(record(0.3, seed=3)[0]).innovations is not None
    assert estimated(record(0.0, seed=3)[0]).innovations is None
    assert estimated(record(0.3, seed=3)[0], innovations=False).innovations is None


def test_an_interval_of_the_batch_fit_that_excludes_what_process_noise_finds_is_said() -> None:
    """Reduction: where the batch fit has found the same, nothing is said."""
    result = estimated(record(0.2, seed=1)[0], innovations=True)
    assert result.innovations is not None
    (with_noise,) = result.innovations.estimates
    told = {}
    for away in (10.0, 1.0):
        narrow = replace(result.batch.estimates[0], value=with_noise.value + 0.01 * away, std=0.01)
        sentences = innovations_sentences(replace(result, batch=replace(result.batch, estimates=(narrow,))))
        told[away] = [s for s in sentences if "believe the values with process noise" in s]
    assert len(told[10.0]) == 1 and "of loss." in told[10.0][0]
    assert told[1.0] == []


@pytest.mark.parametrize("turned", [False, True])
def test_a_fit_that_is_worse_than_a_constant_says_what_to_check(turned: bool) -> None:
    """The sign of the power is turned: the loss of the plate can not make up for that."""
    data, _, _ = record(0.01)
    result = estimated(replace(data, inputs=-data.inputs) if turned else data, innovations=False)
    said = [trouble for trouble in troubles(result) if "check the signs and units of the inputs" in trouble]
    assert len(said) == turned
