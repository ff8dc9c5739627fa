"""What correcting the state by level and tails flow is worth: `python -m benchmarks.estimation.state_correction`.

The laboratory cell with moving air and level set-point, n and C at rest, measured with the noise of the closed-loop
scenarios; over 300 to 700 s the feed flow is a fifth larger than what the estimator is told, or not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.contracts import Estimate, Prior, Sample, Setup
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation
from estimators.rpem.full import rpem_full

SEEDS = tuple(range(1, 6))
ROWS, STEP = 1200, slice(300, 700)
NOISE = {"concentrate_grade": 1e-3, "level": 5e-4, "tails_flow": 5e-7}
CASES: dict[str, tuple[str, ...]] = {"none": (), "level": ("level",), "level and tails flow": ("level", "tails_flow")}


def figures(setup: Setup, seed: int, feed_step: float, correct: Mapping[str, float]) -> list[float]:
    """Errors, root mean square: level [mm], tails flow [ml/s], solids of the pulp [kg], grade; largest of C [%]."""
    model, generator = setup.model, np.random.default_rng(seed)
    acting = np.tile([1.5e-3, 1.67e-4, 0.38], (ROWS, 1))
    acting[:, 0] = np.repeat(generator.uniform(1.2e-3, 1.9e-3, ROWS // 60), 60)
    acting[:, 2] = np.repeat(generator.uniform(0.34, 0.42, ROWS // 120), 120)
    known = acting.copy()
    acting[STEP, 1] *= 1 + feed_step
    start = steady_state(model, acting[0]).state
    truth = Stepper(model, setup.dt).simulate(start, acting)
    outputs = np.full_like(truth.outputs, np.nan)
    for name, std in NOISE.items():
        j = model.index("outputs", name)
        outputs[:, j] = truth.outputs[:, j] + std * generator.standard_normal(ROWS)
    nominal = model.parameter_values[model.indices("parameters", setup.parameters)]
    prior = Prior(0.0, start, nominal, np.diag((0.01 * nominal) ** 2), np.array([NOISE["concentrate_grade"]]))
    samples = [Sample(float(t), u, y) for t, u, y in zip(truth.time, known, outputs, strict=True)]
    corrected = estimates(setup, prior, samples, correct)
    error = np.array([e.state for e in corrected]) - truth.states
    grade = model.index("outputs", "concentrate_grade")
    ahead = np.array([e.prediction[grade] for e in corrected]) - truth.outputs[:, grade]
    solids = error[:, model.indices("states", ["m_valuable", "m_gangue"])].sum(axis=1)
    rows = [1e3 * error[:, model.index("states", "level")], 1e6 * error[:, model.index("states", "tails_flow")]]
    rates = np.array([e.parameters[1] for e in corrected]) / nominal[1] - 1
    return [*(float(np.sqrt(np.mean(e**2))) for e in (*rows, solids, ahead)), 100 * float(np.abs(rates).max())]


def estimates(setup: Setup, prior: Prior, samples: list[Sample], correct: Mapping[str, float]) -> list[Estimate]:
    """Estimates of `rpem_full` over a record."""
    estimator = rpem_full(setup, correct_state=dict(correct))
    state, estimates_in_turn = estimator.init(prior), []
    for sample in samples:
        state, estimate = estimator.update(state, sample)
        estimates_in_turn.append(estimate)
    return estimates_in_turn


def main() -> None:
    """Measure and print."""
    setup = Setup(flotation.make_model(), 1.0, ("growth_exponent", "coalescence_rate"), ("concentrate_grade",))
    columns = ("level, mm", "tails flow, ml/s", "solids, kg", "grade ahead", "C, largest, %")
    title = f"Errors (root mean square) of rpem_full, median over {len(SEEDS)} seeds"
    table = Table("feed flow unknown by", "corrected by", *columns, title=title)
    for feed_step in (0.0, 0.2):
        for label, names in CASES.items():
            correct = {name: NOISE[name] for name in names}
            medians: FloatArray = np.median([figures(setup, seed, feed_step, correct) for seed in SEEDS], axis=0)
            shown = [f"{v:.{d}f}" for v, d in zip(medians, (3, 3, 3, 5, 0), strict=True)]
            table.add_row(f"{feed_step:.0%}", label, *shown)
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
