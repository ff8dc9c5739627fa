"""Random experiments and effects: what is drawn before anything is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects import curves
from benchmarks.hidden_effects.effects.catalogue import LIMITS, Entry
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.plant import control, excitation
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun
from benchmarks.hidden_effects.plant.noise import TYPICAL, draw_noise
from benchmarks.hidden_effects.plant.sensors import OUTPUT_OF

Rng = np.random.Generator
_THIN = tuple(name for name in OUTPUTS if name not in ("air_recovery", "concentrate_flow_m3_s"))

# What amplitude 1 is at an additive sensor, and how many of them a sensor may be off.
SENSOR_UNIT = {name: (1e-7 if name == "concentrate_flow_m3_s" else TYPICAL[name]) for name in OUTPUTS}
SENSOR_LIMIT = {
    "level_sensor": 60.0,
    "tails_sensor": 60.0,
    "grade_sensor": 60.0,
    "air_recovery_sensor": 15.0,
    "concentrate_flow_sensor": 40.0,
}
SECONDS_LIMIT = {"cascade": 60.0, "dead_time": 90.0, "multiplexed": 240.0}


def draw_experiment(
    rng: Rng, *, thin_allowed: bool = True, still: frozenset[str] = frozenset(), loop: str | None = None
) -> Experiment:
    """Draw length, loop, moves, n, C and noise. `still` names inputs (air, feed, level) that never move."""
    rows = int(rng.choice([2400, 3000, 3000, 3000, 3600]))
    burn = int(rng.integers(0, 301))
    loop = loop or str(rng.choice(["open", "pi", "adaptive"], p=[0.65, 0.2, 0.15]))
    if still:
        loop = "open"
    if loop == "open":
        kind = str(rng.choice(excitation.KINDS, p=[0.35, 0.2, 0.15, 0.15, 0.15]))
        moves = excitation.open_loop(rng, burn + rows, kind)
        for at, name in enumerate(("air", "feed", "level")):
            if name in still:
                moves[:, at] = np.median(moves[:, at])
    else:
        moves = control.plan(rng, burn + rows)
    thin = thin_allowed and bool(rng.random() < 0.08)
    return Experiment(
        rows=rows,
        burn=burn,
        n=float(rng.uniform(0.93, 1.08)) * c.GROWTH_EXPONENT,
        C=float(rng.uniform(0.85, 1.2)) * c.COALESCENCE_RATE,
        loop=loop,
        moves=moves,
        controller_seed=int(rng.integers(2**31)),
        noise=draw_noise(rng, burn + rows),
        outputs=_THIN if thin else OUTPUTS,
    )


def limits_of(entry: Entry, shape: str) -> tuple[float, float]:
    """Largest |amplitude| down and up."""
    if shape in SECONDS_LIMIT:
        return 0.0, 250.0 if entry.site == "feed_flow" else SECONDS_LIMIT[shape]
    if shape == "stiction":
        return 0.0, 40.0
    if shape == "gain":
        return 0.3, 0.4
    if shape == "bent":
        return 0.4, 0.5
    if entry.site in SENSOR_LIMIT:
        return (SENSOR_LIMIT[entry.site],) * 2
    return LIMITS[entry.site]


def draw_effect(rng: Rng, entry: Entry, pilot: SimulatedRun) -> Spec:
    """Draw shape, parameters, sign and a first amplitude; the driver's range is that of the run without effects."""
    shape = str(rng.choice(entry.shapes))
    spec = Spec(entry.site, entry.driver, shape, story=entry.story)
    if entry.site in OUTPUT_OF:
        spec = replace(spec, unit=SENSOR_UNIT[OUTPUT_OF[entry.site]], high=0.35)
    if shape == "stiction":
        spec = replace(spec, unit=1e-6)
    if entry.driver == "time":
        parameters = curves.draw_temporal(shape, float(len(pilot.inputs)), rng)
        centre = 0.5 if shape == "swing" else 0.0
        spec = replace(spec, parameters=parameters, centre=centre)
    elif shape in curves.STATIC or shape == "bistable":
        x = pilot.truth[entry.driver]
        low, high = (float(v) for v in np.quantile(x, [0.02, 0.98]))
        if high - low < 1e-3 * high:  # it stands still: a usual range around it
            low, high = 0.9 * low, 1.1 * high
        spec = replace(spec, low=low, high=high, parameters=curves.draw_static(shape, rng), centre=0.5)
        if shape in curves.STATIC:
            curve = spec.static_curve()
            spec = replace(spec, centre=float(np.mean([curve(float(v)) for v in x[::10]])))
    sign = entry.sign or int(rng.choice([-1, 1]))
    if entry.site == "burst_rate" and shape == "hump":
        sign = -1
    down, up = limits_of(entry, shape)
    return replace(spec, amplitude=0.4 * (up if sign > 0 else -down))
