"""An effect means the same in the package and in the generator, which share no code: same inputs, same outputs.

A fit can hide that they differ; here the effect is put in by hand, and what it changes must agree to a few per cent.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes.flotation import make_model
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.generate.draw import draw_experiment
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, run

COLUMNS = {
    "concentrate_grade": "concentrate_grade", "tails_flow": "tails_flow_m3_s", "level": "level_m",
    "concentrate_flow": "concentrate_flow_m3_s", "air_recovery": "air_recovery",
}  # fmt: skip
LOGISTIC = {"middle": 0.5, "width": 0.15}
SETTLED = 20
"""Rows after the start that are not compared: the states of the two are brought to rest in different ways."""


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    drawn = draw_experiment(np.random.default_rng(5), thin_allowed=False, loop="open")
    moves = np.repeat(
        [[1.4e-3, 1.67e-4, 0.38], [1.9e-3, 1.67e-4, 0.38], [1.6e-3, 1.8e-4, 0.36], [1.2e-3, 1.7e-4, 0.39]], 90, axis=0
    )
    return replace(
        drawn, rows=len(moves), burn=0, moves=moves, noise=replace(drawn.noise, step=dict.fromkeys(OUTPUTS, 0.0))
    )


@pytest.fixture(scope="module")
def plain(experiment: Experiment) -> SimulatedRun:
    return run(experiment)


def _static(
    site: str, driver: str, low: float, high: float, amplitude: float, additive: bool = False
) -> tuple[Spec, Effect]:
    """A logistic dependence in the generator's words and, as a spline of its values, in the package's."""
    unit = 0.01 if additive else 1.0
    spec = Spec(site, driver, "logistic", amplitude, dict(LOGISTIC), low, high, 0.5, unit)
    knots = np.linspace(low - 0.5 * (high - low), high + 0.5 * (high - low), 41)
    curve = spec.static_curve()
    change = amplitude * unit * (np.array([curve(float(k)) for k in knots]) - 0.5)
    values = change if additive else np.log1p(change)
    coefficients = {f"value_{k + 1}": float(v) for k, v in enumerate(values)}
    return spec, Effect(site, driver, "curve", coefficients, {"knots": tuple(map(float, knots))})


CASES = {
    "a level sensor fooled by gas": _static("level_sensor", "air_flow", 1.2e-3, 1.9e-3, 1.0, additive=True),
    "bubbles that grow with air": _static("bubble_size", "air_flow", 1.2e-3, 1.9e-3, 0.1),
    "deep froth that entrains less": _static("entrainment", "froth_depth", 0.09, 0.12, -0.4),
    "films that particles hold": _static("burst_rate", "valuable_solids", 1.5, 3.5, -0.3),
    "liberated part floats first": _static("floatability_valuable", "grade", 0.15, 0.35, -0.5),
    "more water over the lip": (
        Spec("concentrate_flow", "constant", "level", 0.5),
        Effect("concentrate_flow", "constant", "shift", {"amplitude": float(np.log(1.5))}),
    ),
    "a feed that follows late": (
        Spec("feed_flow", "lag", "cascade", 30.0),
        Effect("feed_flow", "lag", "lags", {"amplitude": 1.0, "time_constant": 30.0, "time_constant_2": 10.5},
               {"scale": 1.67e-4}),
    ),
}  # fmt: skip
COARSE = {"liberated part floats first": 0.1}
"""The grade acts back after a time that the two take differently (5 s; a third of the froth's residence time)."""


@pytest.mark.parametrize("case", CASES)
def test_an_effect_changes_the_same_by_as_much(case: str, experiment: Experiment, plain: SimulatedRun) -> None:
    spec, effect = CASES[case]
    model = make_model().with_effects([effect])
    model = model.with_parameters({"growth_exponent": experiment.n, "coalescence_rate": experiment.C})
    inputs: FloatArray = experiment.moves
    start = steady_state(model, inputs[0]).state
    ours = Stepper(model, 1.0).simulate(start, inputs, model.parameter_values).outputs
    theirs = run(experiment, [spec])
    for name, column in COLUMNS.items():
        nominal, changed = plain.clean[column][SETTLED:], theirs.clean[column][SETTLED:]
        moved = float(np.ptp(changed - nominal) + np.max(np.abs(changed - nominal)))
        error = float(np.max(np.abs(ours[SETTLED:, model.index("outputs", name)] - changed)))
        assert error < COARSE.get(case, 0.02) * moved + 2e-4 * float(np.max(np.abs(nominal))), (name, error, moved)
