"""Many members tracked at once have the estimates of each tracked alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup, Status
from adaptive_flot.contracts.ensemble_record import EnsembleRecord, tracks_ensembles
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.adaptive_imm import AdaptiveImm
from estimators.ekf import Ekf
from estimators.fixed import Fixed
from estimators.mhe import Mhe
from estimators.rpem import Rpem, rpem_full
from estimators.rpem.state import RpemState
from tests.estimators.toys import decay

Make = Callable[[Setup], Any]
MEMBERS, ROWS = 11, 90
PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
ESTIMATORS: dict[str, Make] = {
    "rpem": Rpem,
    "rpem, central": lambda s: Rpem(s, gradient="central", forgetting=0.98),
    "rpem, recursive": lambda s: Rpem(s, gradient="recursive", forget_to=0.1),
    "rpem, freezing": lambda s: Rpem(s, forgetting=0.95, forget_to=0.1, freeze_s=20.0),
    "rpem, correcting": lambda s: Rpem(s, correct_state={"y": 0.02}),
    "rpem_full": rpem_full,
    "rpem_full, correcting": lambda s: rpem_full(s, correct_state={"y": 0.02}),
    "ekf": Ekf,
    "adaptive_imm": AdaptiveImm,
    "fixed": Fixed,
    "ekf, integrated": lambda s: Ekf(s, walk="integrated", state_noise=1e-3),
}


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)


def members() -> tuple[list[Prior], EnsembleRecord]:
    """Missing measurements, and a wrong one; each member starts elsewhere.

    An absurd one (-50) would make `rpem_full` swing for a while, which magnifies rounding errors to any size.
    """
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(-1, 1, (MEMBERS, ROWS // 5, 1)), 5, axis=1)
    stepper = Stepper(decay(), 0.5)
    y = np.array([stepper.simulate(np.zeros(1), each).outputs for each in u])
    y = y + 0.02 * rng.standard_normal(y.shape)
    y[rng.random(y.shape) < 0.1] = np.nan
    y[3, 40] = -3.0
    priors = [
        Prior(0.0, 0.01 * rng.standard_normal(1), rng.uniform(0.4, 1.4, 2), np.diag([0.04, 0.04]), np.array([0.02]))
        for _ in range(MEMBERS)
    ]
    return priors, EnsembleRecord(np.linspace(0.5, 0.5 * ROWS, ROWS), u, y)


def alone(estimator: Any, state: Any, record: EnsembleRecord, member: int) -> tuple[Any, Track]:
    estimates = []
    for k, t in enumerate(record.time.tolist()):
        known = None if record.parameters is None else record.parameters[member, k]
        state, estimate = estimator.update(
            state, Sample(t, record.inputs[member, k], record.outputs[member, k], (), known)
        )
        estimates.append(estimate)
    return state, Track.of(estimates)


def same_as_alone(estimator: Any, priors: list[Prior], record: EnsembleRecord) -> list[Track]:
    """Estimates, statuses, and the state that the next sample needs."""
    assert tracks_ensembles(estimator)
    states = [estimator.init(prior) for prior in priors]  # type: ignore[attr-defined]
    tracks = []
    for m, (state, track) in enumerate(estimator.track_ensemble(states, record)):
        last, expected = alone(estimator, states[m], record, m)
        assert track.statuses == expected.statuses
        for name in ("time", "prediction", "innovation_std", "parameters", "covariance", "state"):
            np.testing.assert_allclose(
                getattr(track, name), getattr(expected, name), rtol=1e-9, atol=1e-13, err_msg=f"{name} of member {m}"
            )
        for name, value in vars(last).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_allclose(getattr(state, name), value, rtol=1e-9, atol=1e-12, err_msg=name)
        assert state.time == last.time
        tracks.append(track)
    return tracks


@pytest.mark.parametrize("name", ESTIMATORS)
@pytest.mark.parametrize("machine_code", [False, pytest.param(True, marks=needs_compiler)])
def test_estimates_are_those_of_each_member_alone(name: str, machine_code: bool) -> None:
    priors, record = members()
    setup = Setup(replace(decay(), compiled=machine_code), 0.5, ("a", "b"), ("y",))
    tracks = same_as_alone(ESTIMATORS[name](setup), priors, record)
    assert {s for track in tracks for s in track.statuses} >= {Status.OK, Status.MISSING}


@pytest.mark.parametrize("name", ["rpem", "rpem_full", "ekf", "adaptive_imm", "fixed"])
def test_a_sample_that_is_no_number_is_skipped_by_its_own_member_alone(name: str) -> None:
    priors, record = members()
    record.inputs[2, 30] = np.nan
    tracks = same_as_alone(ESTIMATORS[name](Setup(decay(), 0.5, ("a", "b"), ("y",))), priors, record)
    assert [m for m, t in enumerate(tracks) if Status.NOT_FINITE in t.statuses] == [2]
    assert np.isfinite(tracks[2].parameters).all()


@pytest.mark.parametrize("name", ["rpem", "ekf", "adaptive_imm", "fixed"])
def test_what_is_known_of_parameters_is_used(name: str) -> None:
    priors, record = members()
    p = decay().parameter_values * np.linspace(0.9, 1.1, MEMBERS)[:, None, None]
    known = replace(record, parameters=np.broadcast_to(p, (MEMBERS, ROWS, p.shape[-1])))
    same_as_alone(ESTIMATORS[name](Setup(decay(), 0.5, ("a",), ("y",))), [_first(prior) for prior in priors], known)


def test_a_disturbance_that_nobody_measures_is_estimated_beside() -> None:
    priors, record = members()
    setup = Setup(decay(), 0.5, ("a",), ("y",), unmeasured=("b",))
    same_as_alone(AdaptiveImm(setup), [_first(prior) for prior in priors], record)


def _first(prior: Prior) -> Prior:
    return replace(prior, parameters=prior.parameters[:1], covariance=prior.covariance[:1, :1])


class Other(Rpem):
    """It updates in a way of its own, which the lanes of the class it is derived from know nothing of."""

    def update(self, state: RpemState, sample: Sample) -> tuple[RpemState, Estimate]:
        return super().update(state, sample)


class Named(Rpem):
    """It changes nothing of the update."""


def test_an_update_of_its_own_is_not_passed_over() -> None:
    setup = Setup(decay(), 0.5, ("a", "b"), ("y",))
    assert tracks_ensembles(Rpem(setup)) and tracks_ensembles(Named(setup))
    assert not tracks_ensembles(Other(setup)) and not tracks_ensembles(Mhe(setup))


@needs_compiler
@pytest.mark.parametrize("name", ["rpem", "rpem_full", "ekf", "adaptive_imm"])
def test_groups_of_members_give_the_same_bits(name: str) -> None:
    """A study may take its seeds in groups of any size."""
    priors, record = members()
    estimator = ESTIMATORS[name](Setup(replace(decay(), compiled=True), 0.5, ("a", "b"), ("y",)))
    whole = estimator.track_ensemble([estimator.init(p) for p in priors], record)
    for part in (slice(0, 1), slice(1, 6), slice(6, 11)):
        some = EnsembleRecord(record.time, record.inputs[part], record.outputs[part])
        found = estimator.track_ensemble([estimator.init(p) for p in priors[part]], some)
        for (_, track), (_, expected) in zip(found, whole[part], strict=True):
            for what in ("prediction", "parameters", "covariance", "state"):
                np.testing.assert_array_equal(getattr(track, what), getattr(expected, what))


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("name", ["rpem", "rpem_full", "adaptive_imm"])
def test_the_cell(model: Model, name: str) -> None:
    """Over 60 samples, so that a difference of the step would grow."""
    rng = np.random.default_rng(2)
    names = ("growth_exponent", "coalescence_rate")
    setup = Setup(replace(model, compiled=True), 1.0, names, ("concentrate_grade",))
    u = np.repeat(rng.uniform([9.05e-4, 1.4e-4, 0.34], [2.17e-3, 2.0e-4, 0.42], (5, 3, 3)), 20, axis=1)
    x0 = steady_state(model, u[0, 0]).state
    y = np.array([Stepper(model, 1.0).simulate(x0, each).outputs for each in u])
    y = y + 1e-3 * rng.standard_normal(y.shape)
    nominal = model.parameter_values[model.indices("parameters", names)]
    priors = [
        Prior(0.0, x0, nominal * rng.uniform(0.95, 1.05, 2), np.diag((0.05 * nominal) ** 2), np.array([1e-3]))
        for _ in range(5)
    ]
    same_as_alone(ESTIMATORS[name](setup), priors, EnsembleRecord(np.arange(1.0, 61.0), u, y))
