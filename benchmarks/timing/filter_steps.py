"""What the filter of a record gains by a loop of steps, and by derivatives along a run: ratios in one run.

Command: `python -m benchmarks.timing.filter_steps` (half a minute). In a second run the filter itself is faster: its
equations have been compiled then, and are kept.

The cell, 900 rows at 10 s, ten steps an interval. The filter is made and run once with its steps as a loop, and once
with all of an interval as one function. Then eight sizes of the process noise are tried, by the filter itself and by
its derivatives along one run. Both ways agree; how closely is printed.
"""

from __future__ import annotations

import time
from contextlib import nullcontext
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.filtering import filter as module
from adaptive_flot.greybox.filtering.filter import Filtered, RecordFilter
from adaptive_flot.greybox.filtering.noise_model import NoiseModel
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation
from benchmarks.timing.speed import in_turn

ROWS, DT = 900, 10.0
SHARES = (0.3, 0.5, 0.7, 0.9, 1.1, 1.4, 2.0, 3.0)
"""Sizes of the process noise that are tried, as shares of that of the run."""
REPEATS = 5


def record_of(model: Model) -> tuple[Dataset, FloatArray, NoiseModel]:
    """Steps of all inputs around their nominal values, outputs with noise of 1 %, the start, and the noise."""
    rng = np.random.default_rng(1)
    nominal = np.array([1.5e-3, 1.55e-4, 0.35])  # air and feed [m3/s], level setpoint [m]
    inputs = nominal * (1 + 0.05 * rng.choice([-1.0, 0.0, 1.0], (ROWS // 30, len(nominal))).repeat(30, axis=0))
    start = steady_state(model, nominal).state
    run = Stepper(model, DT).simulate(start, inputs[1:], model.parameter_values)
    clean: FloatArray = np.vstack([run.outputs[:1], run.outputs])
    sizes = 0.01 * np.abs(clean).mean(axis=0)
    outputs = clean + sizes * rng.standard_normal(clean.shape)
    noise = NoiseModel(
        {q.name: 1e-4 * q.scale for q in model.states}, dict(zip(model.names("outputs"), sizes, strict=True))
    )
    return Dataset("steps", DT * np.arange(ROWS, dtype=float), DT, inputs, outputs), start, noise


def timed_first_run(
    record: Dataset, noise: NoiseModel, given: tuple[FloatArray, FloatArray, FloatArray], *, as_loop: bool
) -> tuple[float, Filtered]:
    """Seconds of the processor in which a filter is made and run, with nothing kept from before, and its run."""
    begin = time.process_time()
    model = flotation.make_model()
    with nullcontext() if as_loop else patch.object(module, "steps_along", lambda *_: None):
        run = RecordFilter(model, DT, range(len(model.outputs))).run(record, noise, *given)
    return time.process_time() - begin, run


def main() -> None:
    """Measure and print."""
    model = flotation.make_model()
    record, start, noise = record_of(model)
    spread = np.diag((1e-3 * np.array([q.scale for q in model.states])) ** 2)
    given = (start, spread, model.parameter_values)

    whole_s, whole = timed_first_run(record, noise, given, as_loop=False)
    loop_s, loop = timed_first_run(record, noise, given, as_loop=True)
    apart = np.max(np.abs(loop.log_likelihood - whole.log_likelihood))

    own = RecordFilter(model, DT, range(len(model.outputs)))
    run = own.run(record, noise, *given)
    sized = [replace(noise, process={k: s * v for k, v in noise.process.items()}) for s in SHARES]
    cases = [(n, *given) for n in sized]
    exact, near = own.log_likelihoods(record, cases), own.log_likelihoods_near(run, record, cases)
    off = np.max(np.abs(exact.sum(axis=1) - near.sum(axis=1)))
    times = in_turn(
        [lambda: own.log_likelihoods(record, cases), lambda: own.log_likelihoods_near(run, record, cases)], REPEATS
    )
    beside, along = np.median(times, axis=0)
    ratio = np.median(times[:, 0] / times[:, 1])

    table = Table("figure", "as before", "now", "ratio", "largest difference", title="Filter of a record")
    table.add_row(
        "filter made and run once", f"{whole_s:.2f} s", f"{loop_s:.2f} s", f"{whole_s / loop_s:.1f}",
        f"{apart:.1e} in the log-density of a row",
    )  # fmt: skip
    table.add_row(
        f"{len(SHARES)} sizes of the noise", f"{1e3 * beside:.0f} ms", f"{1e3 * along:.0f} ms", f"{ratio:.1f}",
        f"{off:.2g} in the log-likelihood",
    )  # fmt: skip
    Console(width=None if Console().is_terminal else 130).print(table)


if __name__ == "__main__":
    main()
