"""Closed loop on the measured grade: a PI controller, and a predictive one that adapts its own linear model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.simulate import Array
from benchmarks.hidden_effects.plant.excitation import hold

Rng = np.random.Generator
KINDS = ("pi", "adaptive")


def plan(rng: Rng, count: int) -> Array:
    """Grade reference, feed flow and level set-point in time, (count, 3)."""
    return np.column_stack([
        hold(rng, count, 0.15, 0.27, (250.0, 600.0)),
        hold(rng, count, 0.92 * c.FEED_FLOW, 1.08 * c.FEED_FLOW, (250.0, 500.0)),
        hold(rng, count, 0.345, 0.405, (150.0, 300.0)),
    ])  # fmt: skip


@dataclass
class Pi:
    """PI on the mean grade of the last interval; more air, less grade. Anti-windup by clamping."""

    every: int
    gain: float  # of ln Q_air per grade
    seconds: float
    integral: float = 0.0
    air: float = 1.5e-3

    def decide(self, grade: float, reference: float, level: float) -> float:
        """Next air flow [m3/s]."""
        error = grade - reference
        if not math.isfinite(error):
            return self.air
        wish = math.log(1.5e-3) + self.gain * error + self.integral + self.gain * error * self.every / self.seconds
        self.air = min(max(math.exp(wish), c.AIR_LIMITS[0]), c.AIR_LIMITS[1])
        if self.air == math.exp(wish):
            self.integral += self.gain * error * self.every / self.seconds
        return self.air


@dataclass
class Adaptive:
    """One-step predictive controller on grade = a + b ln Q_air + c level, adapted by recursive least squares.

    It moves the air a share of the way to where its model meets the reference, by at most 12 % a move.
    """

    every: int
    forgetting: float
    theta: Array = field(default_factory=lambda: np.array([0.2, -0.2, 0.0]))
    covariance: Array = field(default_factory=lambda: np.diag([0.05, 0.05, 0.5]))
    air: float = 1.5e-3

    def decide(self, grade: float, reference: float, level: float) -> float:
        """Next air flow [m3/s]."""
        if not math.isfinite(grade):
            return self.air
        x = np.array([1.0, math.log(self.air / 1.5e-3), level - 0.375])
        gain = self.covariance @ x / (self.forgetting + x @ self.covariance @ x)
        self.theta = self.theta + gain * (grade - x @ self.theta)
        self.covariance = (self.covariance - np.outer(gain, x @ self.covariance)) / self.forgetting
        slope = min(float(self.theta[1]), -0.05)
        wish = (reference - float(self.theta[0]) - float(self.theta[2]) * (level - 0.375)) / slope
        move = min(0.12, max(-0.12, 0.5 * (wish - math.log(self.air / 1.5e-3))))
        self.air = min(max(self.air * math.exp(move), c.AIR_LIMITS[0]), c.AIR_LIMITS[1])
        return self.air


def make(kind: str, rng: Rng) -> Pi | Adaptive:
    """Controller with random tuning."""
    if kind == "pi":
        return Pi(10, float(rng.uniform(0.8, 2.0)), float(rng.uniform(80.0, 200.0)))
    return Adaptive(20, float(rng.uniform(0.97, 0.995)))
