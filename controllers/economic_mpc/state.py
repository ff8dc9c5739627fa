"""State of the economic MPC, handed from decision to decision."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adaptive_flot.greybox.model import FloatArray
from controllers.economic_mpc.modifiers.learning import ModifierState
from controllers.economic_mpc.scenarios import Misfit
from controllers.economic_mpc.solvers.verification import NlpSolution


@dataclass(frozen=True)
class ProbeState:
    """What the next decision needs.

    Attributes
    ----------
    start
        Since when the budget grows [s].
    spent
        Predicted price of the dips so far [cu].
    asked
        Predicted price of the last dip that was considered [cu].
    until
        End of the last dip [s].
    """

    start: float
    spent: float = 0.0
    asked: float = 0.0
    until: float = -np.inf


@dataclass(frozen=True)
class MpcState:
    """What the next decision needs.

    Attributes
    ----------
    row
        Interval to come, counted from the start.
    due
        Time of the next optimisation [s].
    inputs
        Inputs held now (nu,); None before the first decision.
    plan
        Scaled solution of the last valid optimisation, and its multipliers; None before the first.
    age
        Moves of that plan that have been used.
    bias
        Filtered measured minus predicted value of each limited output. It is added to every prediction, so that a model
        that is off does not break a limit for good.
    heard
        Time of the newest value in each of these filters [s].
    misfit
        How far plans were off.
    tree
        Solution of the last tree; None without one.
    modifiers
        What is known of the plant's slopes; None without modifiers.
    moved_from
        Moved inputs before the last plan (m,), where an early one may follow it; else None.
    probe
        Last dip and what probing has cost; None without probing.
    """

    row: int
    due: float
    inputs: FloatArray | None
    plan: FloatArray | None
    multipliers: tuple[FloatArray, FloatArray] | None
    age: int
    bias: tuple[float, ...]
    heard: tuple[float, ...]
    misfit: Misfit
    probe: ProbeState | None = None
    tree: NlpSolution | None = None
    moved_from: FloatArray | None = None
    modifiers: ModifierState | None = None
