"""What is known before a fit: constants with their uncertainty, and first guesses of initial states."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray
from adaptive_flot.discovery.record.seen import seen_along
from adaptive_flot.errors import RangeError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.forms.form import number
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.steady.steady_state import steady_state

LOOSE = 50.0
"""Standard deviation of the prior of a constant that no reference tells, in its scale: next to nothing."""


SPREAD = 0.4
STARTS = 3
"""Starts of the constants: their own values, then each scattered by a log-normal factor of this spread."""


FAR = 20.0
"""Natural logarithm of the largest factor by which a constant differs from its mean: beyond, none is told from more."""


OPEN = 1.0
"""Standard deviation of the logarithm of a constant from which it is known only together with others."""
LEAST_SHARE = 1e-3
"""Least share of its mean at which what is known of a constant by its ratio may be told about another mean."""


@dataclass(frozen=True)
class Constants:
    """What is known of a model's constants before a fit: normal, some of them in their logarithms.

    With the mean m, the root L, and u of independent standard normal numbers, a constant x is::

        x_i = m_i + (L u)_i                  or, where it is known by its ratio,
        x_i = m_i exp((L u)_i / m_i)

    Both have the same slope at the mean. Records often tell constants up to a common factor. Then a ratio of two is as
    certain at every size in the second form, while in the first it opens as both become small.

    Attributes
    ----------
    names
        Their names (c,).
    mean
        Their values (c,).
    root
        A matrix (c, c) whose product with its transpose is their covariance.
    ratios
        Which of them are known by their ratio to the mean; these are positive.
    """

    names: tuple[str, ...]
    mean: FloatArray
    root: FloatArray
    ratios: frozenset[str] = frozenset()

    def at(self, u: FloatArray) -> FloatArray:
        """The constants (c,) at standard normal numbers u (c,)."""
        moved: FloatArray = self.root @ u
        if not self.ratios:
            return self.mean + moved
        share = np.clip(moved / self._divisor, -FAR, FAR)
        return np.where(self._by_ratio, self.mean * np.exp(share), self.mean + moved)

    def distances(self, values: FloatArray) -> FloatArray:
        """L u of values (c,): the difference to the mean m, or m times the logarithm of the ratio to it."""
        straight: FloatArray = values - self.mean
        if not self.ratios:
            return straight
        ratio = np.where(self._by_ratio, values / self._divisor, 1.0)
        return np.where(self._by_ratio, self.mean * np.log(np.clip(ratio, np.exp(-FAR), np.exp(FAR))), straight)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Derivatives of the distances by the values (c,): one, or the mean over the value."""
        smallest = np.exp(-FAR) * np.abs(self.mean)
        return np.where(self._by_ratio, self.mean / np.where(self._by_ratio, np.maximum(values, smallest), 1.0), 1.0)

    def about(self, mean: FloatArray) -> Constants:
        """The same about another mean (c,): as far in units, or in per cent where known by ratio.

        The mean of such a constant stays positive, though a fit may have it at a bound of zero.
        """
        share = np.where(self._by_ratio, np.maximum(mean / self._divisor, LEAST_SHARE), 1.0)
        about = np.where(self._by_ratio, share * self.mean, mean)
        return replace(self, mean=about, root=self.root * share[:, None])

    def up_to_a_factor(self, least: float = OPEN) -> tuple[str, ...]:
        """Those that are known only together with others: the logarithm of the ratio is open by more than `least`."""
        std = np.sqrt(np.sum(self.root**2, axis=1))
        return tuple(
            n for n, mean, s in zip(self.names, self.mean, std, strict=True) if n in self.ratios and s > least * mean
        )

    @property
    def _by_ratio(self) -> BoolArray:
        return np.array([n in self.ratios for n in self.names], dtype=bool)

    @property
    def _divisor(self) -> FloatArray:
        return np.where(self._by_ratio, self.mean, 1.0)


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
    starts: list[FloatArray] = []
    for k in range(STARTS):
        factors = np.exp(np.random.default_rng(k).normal(0.0, SPREAD, len(own))) if k else np.ones(len(own))
        away = np.linalg.solve(constants.root, constants.distances(own * factors))
        starts.append(np.asarray(away, dtype=np.float64))
    return starts


def at_rest(model: Model, state: FloatArray, record: Dataset) -> FloatArray:
    """A state (nx,), copied, with every hidden store where its balance stands, and what jumps where it is asked to be.

    That is what is asked in the first row of a record.
    """
    names, x = model.names("states"), state.copy()
    for effect in model.effects:
        if effect.form == "store" and effect.driver in names:
            x[names.index(f"{effect.label}.store")] = x[names.index(effect.driver)]
        if effect.family.jumps:
            first = seen_along(model, record.rows(0, 1), x)[0][effect.site][0]
            x[names.index(f"{effect.label}.position")] = first / number(effect.full_settings, "scale")
    return x


def first_states(model: Model, records: Sequence[Dataset]) -> tuple[FloatArray, ...]:
    """Where each record starts, as a first guess: its own states, the steady state, or the model's first guess."""
    states = []
    for record in records:
        guess = model.first_guess
        if record.initial_state is not None and len(record.initial_state) == len(model.states):
            guess = record.initial_state
        elif model.starts_steady:
            with suppress(RangeError):
                guess = steady_state(model, record.inputs[0], model.parameter_values).state
        states.append(at_rest(model, guess, record))
    return tuple(states)
