"""What the rivals share: the nominal cell fitted to a record, its residual, and what each site would change.

A candidate is a site's response to a sustained change (one simulation a site) times a driver: quasi-static, linear.
Rows are every fifth second; columns are stacked over the outputs, each over its noise.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from adaptive_flot.files import replace_path
from benchmarks.hidden_effects.cell.equations import World
from benchmarks.hidden_effects.cell.simulate import Array, SimulationError, replay, steady_state
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS, PROCESS_SITES, SENSOR_OF
from benchmarks.hidden_effects.effects.spec import Spec, influence
from benchmarks.hidden_effects.generate.nominal_fit import REACH, fit_nominal, sensitivity

FIRST, EVERY = 600, 5  # s: transients of an unknown start left out; rows used
BLOCKS = {"fit": (0.0, 0.6), "confirm": (0.6, 0.8), "report": (0.8, 1.0)}
FACTOR = 0.02  # relative change of a site for its response
ONSETS = np.linspace(0.1, 0.75, 9)  # of steps in time, share of the record
DRIVERS = ("air_flow", "feed_flow", "froth_depth", "grade", "solids", "valuable_solids")
Pair = tuple[str, str]
Mask = NDArray[np.bool_]
Kept = TypeVar("Kept")


@dataclass(frozen=True)
class Fitted:
    """A record and the nominal cell fitted to it: (M,) is rows times outputs, one output after the other."""

    residual: Array  # (M,)
    slopes: Array  # (M, 2): to ln n, ln C
    drivers: dict[str, Array]  # (rows,), standardised; those that stand still left out
    outputs: tuple[str, ...]
    noise: Array  # (outputs,)
    time: Array  # (rows,), s
    seconds: float  # length of the record

    def block(self, name: str) -> Mask:
        """Rows (M,) of a block in which the residual is known."""
        low, high = BLOCKS[name]
        share = np.tile(self.time / self.seconds, len(self.outputs))
        return np.asarray(np.isfinite(self.residual) & (share >= low) & (share < high))

    def error(self, explained: Array) -> dict[str, dict[str, float | str]]:
        """Error block of a verdict: residual before, and after what is explained (M,) is taken off; report block."""
        result: dict[str, dict[str, float | str]] = {}
        report, rows = self.block("report"), len(self.time)
        for k, name in enumerate(self.outputs):
            part = slice(k * rows, (k + 1) * rows)
            seen, sigma = report[part], float(self.noise[k])
            before, after = self.residual[part][seen], (self.residual - explained)[part][seen]
            result[name] = {
                "before": sigma * _rms(before), "after": sigma * _rms(after), "noise": sigma, "block": "report",
            }  # fmt: skip
        return result


@dataclass(frozen=True)
class Prepared(Fitted):
    """The same with what each site would change."""

    responses: dict[str, Array]  # site -> (M,)
    late: dict[str, Array]  # sensor -> (M,): one second late

    def candidates(self) -> tuple[Array, list[Pair]]:
        """Every site times every driver, (M, K), and their names; time is a ramp and a step at each of `ONSETS`."""
        count, share = len(self.outputs), self.time / self.seconds
        steps = [("time", np.asarray(share >= onset, dtype=np.float64)) for onset in ONSETS]
        curves = [("constant", np.ones(len(share))), ("time", share), *steps, *self.drivers.items()]
        columns = [r * np.tile(curve, count) for r in self.responses.values() for _, curve in curves]
        names = [(site, driver) for site in self.responses for driver, _ in curves]
        return np.column_stack([*columns, *self.late.values()]), [*names, *((site, "lag") for site in self.late)]


@dataclass(frozen=True)
class BaseRun:
    """The run of the fitted nominal cell, from which the responses are taken."""

    inputs: Array  # (N, 3)
    start: list[float]
    predicted: dict[str, Array]  # (N,) each
    n: float
    C: float


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if len(x) else float("nan")


def noise_of(y: Array) -> float:
    """Robust standard deviation of white noise from first differences."""
    d = np.diff(y)
    d = d[np.isfinite(d)]
    return float(max(np.median(np.abs(d)) / 0.6745 / np.sqrt(2.0), 1e-3 * np.nanstd(y), 1e-12))


def fit(file: Path) -> tuple[Fitted, BaseRun]:
    """Fit the nominal cell to the first 60 % of a record."""
    table = pd.read_csv(file)
    inputs = table[list(INPUTS)].to_numpy(dtype=np.float64)
    measured = {name: table[name].to_numpy(dtype=np.float64) for name in OUTPUTS if name in table}
    noise = {name: noise_of(y) for name, y in measured.items()}
    start = steady_state(inputs[0], World())
    count, names = len(table), tuple(measured)
    part = slice(FIRST, int(0.6 * count))
    nominal = fit_nominal(inputs, measured, noise, start, part, (World.n, World.C), iterations=3)
    base, rows = nominal.predicted, np.arange(FIRST, count, EVERY)
    sigma = np.array([noise[name] for name in names])
    slopes = sensitivity(np.log(np.array([nominal.n, nominal.C])), inputs, start, base, names)
    fitted = Fitted(
        residual=_stack({name: measured[name] - base[name] for name in names}, names, sigma, rows),
        slopes=np.column_stack([_stack(s, names, sigma, rows) for s in slopes]),
        drivers={name: _standard(base[name][rows]) for name in DRIVERS if _moves(base[name][rows])},
        outputs=names,
        noise=sigma,
        time=rows.astype(np.float64),
        seconds=float(count),
    )
    return fitted, BaseRun(inputs, start, base, nominal.n, nominal.C)


def prepare(fitted: Fitted, run: BaseRun) -> Prepared:
    """Add what each site would change: half of the time that the rivals take."""
    rows, names, base = fitted.time.astype(int), fitted.outputs, run.predicted
    zero = dict.fromkeys(names, np.zeros(len(run.inputs)))

    def stack(columns: dict[str, Array]) -> Array:
        return _stack(columns, names, fitted.noise, rows)

    sigma = dict(zip(names, fitted.noise, strict=True))
    late = {SENSOR_OF[name]: stack(zero | {name: -np.gradient(base[name])}) for name in names}
    sensors = {SENSOR_OF[name]: stack(zero | {name: np.full(len(run.inputs), sigma[name])}) for name in names}
    inside = {site: stack(r) for site, r in _responses(run.inputs, run.start, base, run.n, run.C).items()}
    return Prepared(**vars(fitted), responses=inside | sensors, late=late)


def _stack(columns: dict[str, Array], names: tuple[str, ...], noise: Array, rows: NDArray[np.int_]) -> Array:
    return np.concatenate([columns[name][rows] / s for name, s in zip(names, noise, strict=True)])


def _responses(inputs: Array, start: list[float], base: dict[str, Array], n: float, C: float
               ) -> dict[str, dict[str, Array]]:  # fmt: skip
    """Change of the outputs for a sustained relative change at each process site that the cell survives."""
    responses = {}
    for site in PROCESS_SITES:
        world = World(n, C, (influence(Spec(site, "constant", "level", FACTOR), inputs[0].tolist()),))
        try:
            moved = replay(world, inputs, start)
        except SimulationError:
            continue
        responses[site] = {name: (moved[name] - base[name]) / FACTOR for name in OUTPUTS}
    return responses


def _moves(x: Array) -> bool:
    return bool(np.std(x) > 1e-3 * abs(float(np.mean(x))))


def _standard(x: Array) -> Array:
    return np.asarray((x - x.mean()) / x.std(), dtype=np.float64)


def fitted(file: Path) -> Fitted:
    """`fit`, kept beside the records (DIR/cache): five rivals, one fit."""
    return _kept(file, "fit", lambda: fit(file))[0]


def prepared(file: Path) -> Prepared:
    """`prepare`, kept likewise: only those who ask for candidates wait for it."""
    return _kept(file, "responses", lambda: prepare(*_kept(file, "fit", lambda: fit(file))))


def _kept(file: Path, what: str, make: Callable[[], Kept]) -> Kept:
    cache = file.parent.parent / "cache" / f"{file.stem}.{what}.pickle"
    if cache.is_file():
        known: Kept = pickle.loads(cache.read_bytes())
        return known
    made = make()
    with replace_path(cache) as temporary:
        temporary.write_bytes(pickle.dumps(made))
    return made


def least_squares(columns: Array, y: Array, rows: Mask) -> Array:
    """Coefficients of y on columns over the chosen rows."""
    return np.asarray(np.linalg.lstsq(columns[rows], y[rows], rcond=None)[0], dtype=np.float64)


def adapt(p: Fitted) -> Array:
    """What new values of n and C (bounded) explain of the residual, fitted on the first block, (M,)."""
    shift = least_squares(p.slopes, p.residual, p.block("fit"))
    return np.asarray(p.slopes @ np.clip(shift, -REACH, REACH), dtype=np.float64)
