"""Of an event that passes, only the rows that it touches say anything, and none beside an edge that nobody saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from adaptive_flot.discovery.assessment.likelihood import difference_with_confirm_rows, loglik_difference_sds
from adaptive_flot.discovery.assessment.reduction import reduction, squared_errors
from adaptive_flot.discovery.assessment.telling_rows import (
    edges,
    largest_by_chance,
    on_telling_rows,
    telling_rows,
    touched_rows,
)
from adaptive_flot.discovery.assessment.verification import verify
from adaptive_flot.discovery.candidates.shapes.pulses import PULSE
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.fitting.fitter import Fitter
from adaptive_flot.discovery.record.noise import Noise
from adaptive_flot.discovery.record.problem import Problem, make_problem
from adaptive_flot.discovery.results import SURE
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.stepping.record import RecordSimulator
from tests.discovery.candidates.test_pulses import FIRST, KNOWN, LAST, with_a_pulse
from tests.discovery.heated import DT, NOISE, changed, heated_tank, tank_record

ADAPTED = ("efficiency", "loss")
WIDTH = 15.0
DYING = 200
"""Rows after a pulse of the loss at which its effect has nearly gone."""


@pytest.fixture(scope="module")
def fits() -> tuple[Problem, Fit, Fit]:
    """The tank with a pulse of its thermometer, fitted without and with it."""
    problem = make_problem(with_a_pulse(), heated_tank(), ADAPTED, burn_in=30, guard=5)
    return problem, *fitted(problem, DT * (FIRST + 1), DT * (LAST - FIRST))


def fitted(problem: Problem, begin: float, length: float, site: str = "thermometer") -> tuple[Fit, Fit]:
    base = Fitter(problem).fit(heated_tank())
    assert base is not None
    pulse = Effect(site, "time", PULSE, settings={"count": 1.0, "width": WIDTH})
    model = heated_tank().with_effects([pulse])
    start = {"amplitude": 0.3, "on_1": begin, "for_1": length}
    first = {pulse.parameter(name): value for name, value in start.items()}
    fit = Fitter(problem).fit(model, (*base.names, *first), first, like=base)
    assert fit is not None
    return base, fit


def test_all_rows_tell_of_what_does_not_pass(fits: tuple[Problem, Fit, Fit]) -> None:
    problem, base, _ = fits
    assert (telling_rows(problem, [base], "confirm", ("estimate",)) == problem.rows("confirm")).all()
    assert on_telling_rows(problem, base, base, "confirm", ("estimate",)) is problem


def test_rows_that_tell_lie_in_the_pulse(fits: tuple[Problem, Fit, Fit]) -> None:
    problem, base, fit = fits
    (pulse,) = fit.model.fitted_effects()
    begin, end = edges(pulse)
    time = problem.record.time
    inside = (time > begin + 3 * WIDTH) & (time < end - 3 * WIDTH) & problem.rows("estimate")
    near = (time > begin - 3 * WIDTH) & (time < end + 3 * WIDTH)
    telling = telling_rows(problem, (base, fit), "estimate")
    assert telling[inside].all()
    assert not telling[~near].any()


def test_no_row_counts_that_lies_beside_an_edge_between_fitted_rows(fits: tuple[Problem, Fit, Fit]) -> None:
    """From each edge to the nearest fitted row on both sides, nothing tells."""
    problem, base, fit = fits
    (pulse,) = fit.model.fitted_effects()
    asked, telling = problem.rows("estimate"), telling_rows(problem, (base, fit), "confirm", ("estimate",))
    assert telling.any()
    for edge in edges(pulse):
        row = int(np.searchsorted(problem.record.time, edge))
        for step in (-1, 1):
            k = row if step > 0 else row - 1
            while not asked[k]:
                assert not telling[k]
                k += step


def test_where_no_other_rows_tell_those_beside_an_edge_do(fits: tuple[Problem, Fit, Fit]) -> None:
    """A pulse that no fitted row saw: all of its rows lie beside its edges."""
    problem, base, fit = fits
    time = problem.record.time
    begin, end = edges(fit.model.fitted_effects()[0])
    inside = (time >= begin) & (time <= end)
    unseen = replace(problem, splits=np.where(inside, "confirm", problem.splits))
    telling = telling_rows(unseen, (base, fit), "confirm", ("estimate",))
    assert telling.sum() > 0.9 * inside.sum()


def test_all_rows_tell_where_the_pulse_came_with_the_model_or_another_effect_is_compared(
    fits: tuple[Problem, Fit, Fit],
) -> None:
    """A model that was extended once has its pulse; it is no question to the record any more."""
    problem, base, fit = fits
    known = replace(fit, names=base.names)
    assert (telling_rows(problem, (base, known), "confirm", ("estimate",)) == problem.rows("confirm")).all()
    draught = Effect("heat_loss", "fan_speed", "power", settings={"reference": 10.0})
    names = tuple(draught.parameter(c.name) for c in draught.terms)
    other = Fitter(problem).fit(base.model.with_effects([draught]), names, like=base)
    assert other is not None
    assert (telling_rows(problem, (other, fit), "confirm", ("estimate",)) == problem.rows("confirm")).all()


def test_only_the_split_that_is_asked_loses_rows(fits: tuple[Problem, Fit, Fit]) -> None:
    problem, base, fit = fits
    fewer = on_telling_rows(problem, base, fit, "report", ("estimate", "confirm"))
    assert 0 < fewer.rows("report").sum() < problem.rows("report").sum()
    assert not (fewer.rows("report") & ~problem.rows("report")).any()
    for split in ("estimate", "confirm"):
        assert (fewer.rows(split) == problem.rows(split)).all()


def test_a_pulse_that_is_there_is_confirmed_and_surely_better(fits: tuple[Problem, Fit, Fit]) -> None:
    problem, base, fit = fits
    assert verify(problem, base, fit).confirmed
    (sd,) = loglik_difference_sds(problem, fit, [base])
    assert base.loss - fit.loss > 4 * sd


def test_rows_that_fitted_neither_tell_a_pulse_from_one_elsewhere(fits: tuple[Problem, Fit, Fit]) -> None:
    """A loss that falls for a while draws the fitted rows as well as it can; on the confirm rows it is worse."""
    problem, _, fit = fits
    _, elsewhere = fitted(problem, DT * (FIRST + 1), DT * (LAST - FIRST), "heat_loss")
    more, deviation = difference_with_confirm_rows(problem, fit, elsewhere)
    assert more > 0
    assert elsewhere.loss - fit.loss + more > SURE * deviation
    assert difference_with_confirm_rows(problem, fit, fit) == (0.0, 0.0)


def test_rows_beside_an_edge_speak_for_a_pulse_but_not_against_it() -> None:
    """Its begin lies between fitted rows, in a block of the confirm split. Its other confirm rows see it die away.

    Those hold it alike with and without: they alone confirm nothing. The block of the begin does.
    """
    plain, rng = tank_record(KNOWN), np.random.default_rng(0)
    pulse = Effect("heat_loss", "time", PULSE, settings={"count": 1.0, "width": WIDTH})
    truth = {"amplitude": 0.3, "on_1": DT * (FIRST + 1), "for_1": DT * (LAST - FIRST)}
    values = {"loss": 60.0} | {pulse.parameter(n): v for n, v in truth.items()}
    model = heated_tank().with_effects([pulse]).with_parameters(values)
    outputs = RecordSimulator(model, DT).outputs(plain, plain.outputs[0], model.parameter_values)[:, 0]
    record = changed(plain, outputs + rng.normal(0, NOISE, len(plain)))
    splits = np.full(len(plain), "estimate", dtype="<U8")
    splits[FIRST - 10 : FIRST + 60] = splits[LAST + DYING : LAST + DYING + 20] = "confirm"
    problem = replace(make_problem(record, heated_tank(), ADAPTED, burn_in=30, guard=5), splits=splits)
    base, fit = fitted(problem, truth["on_1"], truth["for_1"], "heat_loss")
    telling = telling_rows(problem, (base, fit), "confirm", ("estimate",))
    assert telling.sum() >= 16 and not telling[: LAST + DYING].any()
    beside = touched_rows(problem, (base, fit), "confirm") & problem.rows("confirm")
    assert beside[FIRST + 20 : FIRST + 60].all()
    size = problem.weights * fit.noise.stationary_std()
    old, new = (np.nansum(squared_errors(problem, f, size, telling), axis=1) for f in (base, fit))
    assert not reduction(old, new, 20)[1][0] > 0, "these rows confirm it by themselves: nothing is tested"
    checked = verify(problem, base, fit)
    assert checked.confirmed and checked.reduction > 0.5 and checked.reduction95[0] > 0


@pytest.mark.parametrize("seed", range(3))
def test_a_pulse_that_is_not_there_is_not_confirmed(seed: int) -> None:
    """Fitted to noise at some place; its few rows of noise must not pass for proof."""
    problem = make_problem(tank_record(KNOWN, seed=seed), heated_tank(), ADAPTED, burn_in=30, guard=5, cycles=8)
    base, fit = fitted(problem, DT * (FIRST + 1), DT * (LAST - FIRST))
    assert not verify(problem, base, fit).confirmed


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_noise_exceeds_the_largest_by_chance_once_in_twenty_times(memory: float) -> None:
    """Against noise that is drawn, with and without a memory."""
    rows, rng = 40, np.random.default_rng(0)
    noise = Noise(np.array([np.sqrt(1 - memory**2)]), np.array([[memory]]))
    drawn = lfilter([noise.std[0]], [1, -memory], rng.standard_normal((4000, rows + 100)))[:, 100:]
    beyond = np.sqrt(np.mean(drawn**2, axis=1)) > largest_by_chance(noise, rows)[0]
    assert 0.03 < beyond.mean() < 0.07
