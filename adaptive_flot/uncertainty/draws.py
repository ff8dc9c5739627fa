"""Draws of uncertain constants, simulated side by side, and their quantiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adaptive_flot.errors import ModelError, RangeError
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, Dataset
from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.uncertainty.ranges_file import Uncertain
from adaptive_flot.uncertainty.ranking import Share, shares_of

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
FEWEST_BLOCKS = 8
"""Blocks of draws, each of as many as there are constants and two more: fewer say nothing of a share."""
AT_ONCE = 128
"""Draws that are simulated at once: a record of 2400 rows takes 20 megabytes for each state then."""
SEED = 1


@dataclass(frozen=True)
class Draws:
    """What came of the draws.

    Attributes
    ----------
    record
        The inputs.
    model
        The model with its nominal constants.
    constants
        The d uncertain constants.
    values
        Their values in each draw (M, d).
    outputs
        Outputs of each draw (M, N, ny); NaN for one that left the model's range.
    nominal
        Outputs with the nominal constants (N, ny).
    """

    record: Dataset
    model: Model
    constants: tuple[Uncertain, ...]
    values: FloatArray
    outputs: FloatArray
    nominal: FloatArray

    @property
    def good(self) -> list[int]:
        """Draws that stayed within the model's range."""
        return np.flatnonzero(np.isfinite(self.outputs[:, -1, 0])).tolist()

    def quantiles(self, name: str) -> FloatArray:
        """Quantiles of an output over the good draws, at every row (N, 5); see `QUANTILES`."""
        j = self.model.index("outputs", name)
        return np.quantile(self.outputs[self.good, :, j], QUANTILES, axis=0).T

    def means(self, name: str) -> FloatArray:
        """Mean of an output over the record, of each draw (M,); NaN where the draw is no good."""
        return np.asarray(self.outputs[:, :, self.model.index("outputs", name)].mean(axis=1))

    def shares(self, name: str) -> tuple[Share, ...]:
        """Share of each constant in the variance of the output's mean over the record, the largest first."""
        return shares_of([c.parameter.label for c in self.constants], self.means(name), SEED)

    def table(self) -> pd.DataFrame:
        """`time_s`, the inputs, and for each output its nominal value and its quantiles as `_nominal`, `_q05`, ..."""
        columns = {TIME_COLUMN: self.record.time}
        columns |= {q.column: self.record.inputs[:, j] for j, q in enumerate(self.model.inputs)}
        for j, q in enumerate(self.model.outputs):
            columns[f"{q.column}_nominal"] = self.nominal[:, j]
            bands = self.quantiles(q.name)
            columns |= {f"{q.column}_q{round(100 * p):02d}": bands[:, k] for k, p in enumerate(QUANTILES)}
        return pd.DataFrame(columns)


def blocks_of(draws: int, constants: int) -> int:
    """Number of blocks, a power of two, whose draws are no more than asked for.

    Raises
    ------
    ModelError
        Too few draws for so many constants.
    """
    each = constants + 2
    if draws < FEWEST_BLOCKS * each:
        raise ModelError(
            f"--draws {draws} is too few for {constants} uncertain constants; give at least {FEWEST_BLOCKS * each}"
        )
    return 1 << int(math.log2(draws // each))


def draw(
    model: Model,
    constants: Sequence[Uncertain],
    record: Dataset,
    draws: int,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Draws:
    """Simulate a record with many draws of the constants.

    The draws are a scrambled Sobol' sequence in the arrangement of Saltelli et al., Comput. Phys. Commun. 181 (2010):
    each draw is one of the joint distribution, and all together give the shares of the variance. Each starts at the
    states in the record, else at its own steady state of the first inputs.

    Parameters
    ----------
    model
        The model, as machine code or not.
    constants
        Its d uncertain constants.
    record
        Inputs (N, nu); its outputs are not used.
    draws
        Most draws; as many are made as 2^k (d + 2) allows.
    progress
        Told how many draws are done, of how many.

    Raises
    ------
    ModelError
        Too few draws, or a constant that the record itself moves.
    RangeError
        The nominal run, or more than half of the draws, leave the model's physical range.
    """
    moved = {model.index("parameters", name) for name in record.parameters}
    places = [model.index("parameters", c.parameter.name) for c in constants]
    if moved:
        name = next(iter(record.parameters))
        raise ModelError(f"{record.name}: moves the constant {name!r}; with draws of constants leave that column out")
    blocks = blocks_of(draws, len(constants))
    from SALib.sample import sobol  # takes seconds to import

    problem = {
        "num_vars": len(constants),
        "names": list(range(len(constants))),
        "bounds": [[0.0, 1.0]] * len(constants),
    }
    unit = sobol.sample(problem, blocks, calc_second_order=False, seed=SEED)
    values = np.column_stack([c.values(np.clip(u, 1e-12, 1 - 1e-12)) for c, u in zip(constants, unit.T, strict=True)])
    nominal = model.parameter_values
    parameters = np.vstack([nominal, np.tile(nominal, (len(values), 1))])
    parameters[1:, places] = values
    ensemble = Ensemble(model, record.dt)
    outputs = []
    for first in range(0, len(parameters), AT_ONCE):
        outputs.append(_simulated(ensemble, record, parameters[first : first + AT_ONCE]))
        progress(min(first + AT_ONCE, len(parameters)) - 1, len(values))
    every = np.concatenate(outputs)
    made = Draws(record, model, tuple(constants), values, every[1:], every[0])
    if not np.isfinite(made.nominal).all():
        raise RangeError(
            f"{record.name}: the run with the nominal constants leaves the model's range; check the inputs"
        )
    if 2 * len(made.good) <= len(values):
        raise RangeError(
            f"{record.name}: {len(values) - len(made.good)} of {len(values)} draws leave the model's physical range; "
            "give smaller ranges"
        )
    return made


def _simulated(ensemble: Ensemble, record: Dataset, parameters: FloatArray) -> FloatArray:
    """Outputs (M, N, ny), first row included; NaN for a member that leaves its physical range."""
    model, t0 = ensemble.model, float(record.time[0])
    starts = np.array([_start(model, record, p) for p in parameters])
    run = ensemble.simulate(starts, record.inputs[1:], parameters, t0, keep=["states", "outputs"])
    stepper, ny = Stepper(model, record.dt), len(model.outputs)
    first = np.array(
        [stepper.outputs_at(x, t0, record.inputs[0], p)[:ny] for x, p in zip(starts, parameters, strict=True)]
    )
    outputs: FloatArray = np.concatenate([first[:, None], run.outputs], axis=1)
    lower, upper = (np.array([getattr(q, end) for q in model.states]) for end in ("lower", "upper"))
    inside = ((run.states >= lower) & (run.states <= upper)).all(axis=(1, 2)) & np.isfinite(outputs).all(axis=(1, 2))
    outputs[~inside] = np.nan
    return outputs


def _start(model: Model, record: Dataset, parameters: FloatArray) -> FloatArray:
    if record.initial_state is not None:
        return record.initial_state
    try:
        return steady_state(model, record.inputs[0], parameters, time=float(record.time[0])).state
    except RangeError:  # no steady state with these constants
        return np.full(len(model.states), np.nan)
