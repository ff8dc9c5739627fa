"""What is known before a fit: constants with their uncertainty, and first guesses of initial states."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady_state import steady_state

LOOSE = 50.0
"""Standard deviation of the prior of a constant that no reference tells, in its scale: next to nothing."""


SPREAD = 0.4
STARTS = 3
"""Starts of the constants: their own values, then each scattered by a log-normal factor of this spread."""


@dataclass(frozen=True)
class Constants:
    """What is known of a model's constants before a fit: normal, with this mean and covariance.

    Attributes
    ----------
    names
        Their names (c,).
    mean
        Their values (c,).
    root
        A matrix (c, c) whose product with its transpose is their covariance.
    """

    names: tuple[str, ...]
    mean: FloatArray
    root: FloatArray


def loose_constants(model: Model, names: Sequence[str]) -> Constants:
    """Constants of which nothing is known but the order of size."""
    chosen = [model.parameters[i] for i in model.indices("parameters", names)]
    scale = np.array([p.scale or abs(p.value) or 1.0 for p in chosen])
    return Constants(tuple(names), np.array([p.value for p in chosen]), np.diag(LOOSE * scale))


def scattered_starts(model: Model, constants: Constants) -> list[FloatArray]:
    """Starts of the constants (c,), in units of their prior: the model's own values, then scattered ones."""
    if not constants.names:
        return [np.empty(0)]
    own = np.array([model.parameters[i].value for i in model.indices("parameters", constants.names)])
    starts = []
    for k in range(STARTS):
        factors = np.exp(np.random.default_rng(k).normal(0.0, SPREAD, len(own))) if k else np.ones(len(own))
        starts.append(np.linalg.solve(constants.root, own * factors - constants.mean))
    return starts


def stores_at_rest(model: Model, state: FloatArray) -> FloatArray:
    """A state (nx,), copied, with every hidden store where its balance stands."""
    names, x = model.names("states"), state.copy()
    for effect in model.effects:
        if effect.form == "store" and effect.driver in names:
            x[names.index(f"{effect.label}.store")] = x[names.index(effect.driver)]
    return x


def first_states(model: Model, records: Sequence[Dataset]) -> tuple[FloatArray, ...]:
    """Where each record starts, as a first guess: its own states, the steady state, or the model's first guess."""
    states = []
    for record in records:
        guess = np.array([model.initial_guess.get(s.name, s.scale) for s in model.states])
        if record.initial_state is not None and len(record.initial_state) == len(model.states):
            guess = record.initial_state
        elif model.starts_steady:
            with suppress(RangeError):
                guess = steady_state(model, record.inputs[0], model.parameter_values).state
        states.append(stores_at_rest(model, guess))
    return tuple(states)
