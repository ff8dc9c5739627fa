"""Shapes of hidden effects: of a normalised driver, of time, and with a memory of their own.

None is of the usual catalogue (powers, exponentials, splines, sharp steps, straight ramps, first-order lags): Hill and
arctan curves, hard limits, humps, bistable switches, smooth and second-order steps, Gompertz growth, wandering.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.interpolate import CubicSpline

Curve = Callable[[float], float]
Parameters = dict[str, float | list[float]]
Rng = np.random.Generator


def logistic(x: float) -> float:
    """1 / (1 + exp(-x)) without overflow."""
    return 0.5 * (1.0 + math.tanh(0.5 * x))


def _hill(p: Mapping[str, float]) -> Curve:
    k, power = p["half"], p["power"]

    def curve(z: float) -> float:
        w = float(max(z, 0.0) ** power)
        return float(w / (k**power + w))

    return curve


# Shapes of z = (driver - low) / (high - low), where low and high are the range the record covers; about 0 .. 1 each.
STATIC: dict[str, Callable[[Mapping[str, float]], Curve]] = {
    "hill": _hill,
    "logistic": lambda p: lambda z: logistic((z - p["middle"]) / p["width"]),
    "hard_limit": lambda p: lambda z: min(1.0, max(0.0, (z - p["from"]) / (p["to"] - p["from"]))),
    "kink": lambda p: lambda z: min(1.2, max(0.0, z - p["from"]) / (1.0 - p["from"])),
    "hump": lambda p: lambda z: math.exp(-(((z - p["middle"]) / p["width"]) ** 2)),
    "arctan": lambda p: lambda z: 0.5 + math.atan((z - p["middle"]) / p["width"]) / math.pi,
}


def draw_static(shape: str, rng: Rng) -> Parameters:
    """Random parameters of a static shape or of the bistable switch."""
    draws: dict[str, dict[str, tuple[float, float]]] = {
        "hill": {"half": (0.3, 0.7), "power": (1.5, 4.0)},
        "logistic": {"middle": (0.3, 0.7), "width": (0.08, 0.2)},
        "hard_limit": {"from": (0.05, 0.35), "to": (0.6, 0.95)},
        "kink": {"from": (0.1, 0.5)},
        "hump": {"middle": (0.3, 0.7), "width": (0.25, 0.45)},
        "arctan": {"middle": (0.3, 0.7), "width": (0.1, 0.3)},
        "bistable": {"middle": (0.4, 0.6), "half_width": (0.12, 0.25), "seconds": (10.0, 40.0)},
    }
    return {name: float(rng.uniform(*limits)) for name, limits in draws[shape].items()}


def _smooth_step(p: Mapping[str, float]) -> Curve:
    return lambda t: logistic((t - p["onset"]) / p["width"])


def _washout(p: Mapping[str, float]) -> Curve:
    """Two equal stirred tanks in series after a step."""

    def curve(t: float) -> float:
        s = max(0.0, t - p["onset"]) / p["seconds"]
        return 1.0 - (1.0 + s) * math.exp(-s)

    return curve


def _dose(p: Mapping[str, float]) -> Curve:
    """Rise through two tanks, then slow depletion."""
    rise = _washout(p)
    return lambda t: rise(t) * math.exp(-max(0.0, t - p["onset"]) / p["decay"])


def _gompertz(p: Mapping[str, float]) -> Curve:
    return lambda t: math.exp(-5.0 * math.exp(-min(50.0, max(-50.0, (t - p["onset"]) / p["seconds"]))))


def _fouling(p: Mapping[str, float]) -> Curve:
    """Square root of the time since the onset (growth of a scale by diffusion), 1 at the end."""
    return lambda t: math.sqrt(max(0.0, t - p["onset"]) / (p["end"] - p["onset"]))


def _swing(p: Mapping[str, float]) -> Curve:
    return lambda t: 0.5 * (1.0 + math.sin(2.0 * math.pi * (t / p["period"] + p["phase"])))


def _plateau(p: Mapping[str, float]) -> Curve:
    """On for a while, then off again, both smooth."""
    return lambda t: logistic((t - p["onset"]) / p["width"]) * logistic((p["onset"] + p["length"] - t) / p["width"])


def _ramp(p: Mapping[str, float]) -> Curve:
    return lambda t: min(1.0, max(0.0, (t - p["onset"]) / p["length"]))


TEMPORAL: dict[str, Callable[[Mapping[str, float]], Curve]] = {
    "smooth_step": _smooth_step,
    "washout": _washout,
    "dose": _dose,
    "gompertz": _gompertz,
    "fouling": _fouling,
    "swing": _swing,
    "plateau": _plateau,
    "ramp": _ramp,  # of drifting n and C only
}


def draw_temporal(shape: str, seconds: float, rng: Rng) -> Parameters:
    """Random parameters of a shape in time for a record of that many seconds (0 = its first row)."""
    onset = float(rng.uniform(0.12, 0.5) * seconds)  # a search that keeps the end apart must see it too
    match shape:
        case "smooth_step":
            return {"onset": onset, "width": float(rng.uniform(2.0, 25.0))}
        case "washout":
            return {"onset": onset, "seconds": float(rng.uniform(30.0, 150.0))}
        case "dose":
            return {"onset": onset, "seconds": float(rng.uniform(30.0, 90.0)), "decay": float(rng.uniform(600, 2000))}
        case "gompertz":
            return {"onset": onset, "seconds": float(rng.uniform(80.0, 300.0))}
        case "fouling":
            return {"onset": onset, "end": seconds}
        case "swing":
            return {"period": float(rng.uniform(0.35, 0.9) * seconds), "phase": float(rng.uniform(0.0, 1.0))}
        case "plateau":
            return {"onset": onset, "width": float(rng.uniform(2.0, 15.0)), "length": float(rng.uniform(500, 1200))}
        case "ramp":
            return {"onset": onset, "length": float(rng.uniform(400.0, 0.95 * seconds - onset))}
        case "wander":
            count = int(seconds / rng.uniform(200.0, 400.0)) + 2
            steps = rng.standard_normal(count)
            values = np.zeros(count)
            for k in range(1, count):
                values[k] = 0.7 * values[k - 1] + steps[k]
            values /= np.abs(values).max()
            return {"every": seconds / (count - 1), "values": [float(v) for v in values]}
    raise KeyError(shape)


def temporal(shape: str, parameters: Parameters) -> Curve:
    """The curve of time [s]; flat before the record starts."""
    if shape == "wander":
        values = parameters["values"]
        every = parameters["every"]
        assert isinstance(values, list) and isinstance(every, float)
        end = every * (len(values) - 1)
        spline = CubicSpline(every * np.arange(len(values)), values)
        c, x = spline.c, spline.x

        def curve(t: float) -> float:
            t = min(end, max(0.0, t))
            k = min(len(x) - 2, int(t / every))
            s = t - float(x[k])
            return float(((c[0, k] * s + c[1, k]) * s + c[2, k]) * s + c[3, k])

        return curve
    numbers = {name: float(v) for name, v in parameters.items() if not isinstance(v, list)}
    inner = TEMPORAL[shape](numbers)
    return (lambda t: inner(max(t, 0.0))) if shape == "swing" else inner


def onset_of(shape: str, parameters: Parameters) -> float | None:
    """When a shape in time starts to matter [s], None for one that is always there."""
    onset = parameters.get("onset")
    return onset if isinstance(onset, float) else None
