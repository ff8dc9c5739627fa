"""What a search found, as a change of the model in use: effects with their sizes, and parameters fitted with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from adaptive_flot.contracts import Setup
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model

TAKEN_UP = ("named", "class")
"""Verdicts that extend a model; discovery gives neither without confirmation on rows that did not enter the search."""


@dataclass(frozen=True)
class Extension:
    """A change of a model in use.

    Attributes
    ----------
    effects
        Effects to add; none changes nothing.
    parameters
        New values of adapted parameters by full name, each in its unit; those left out are kept.
    initial_state
        State of the extended model at the first row of the record that it was fitted to (nx,); None: states are
        carried over.
    """

    effects: tuple[Effect, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    initial_state: FloatArray | None = None

    def model(self, before: Model) -> Model:
        """The model with the effects; its own parameters stay, the adapted ones are the estimator's."""
        return before.with_effects(self.effects)


@dataclass(frozen=True)
class Finding:
    """Result of a search: its verdict, and what follows from it."""

    verdict: Verdict
    extension: Extension


def search_record(setup: Setup, record: Dataset, processes: int) -> Finding:
    """Search a record for what the model of an estimator lacks.

    A class is represented by its best member: the others predict the record as well.

    Raises
    ------
    AdaptiveFlotError
        The model or the record can not be searched.
    """
    discovery = discover(setup.model, record, adapted=setup.parameters, processes=processes)
    if discovery.verdict.word not in TAKEN_UP:
        return Finding(discovery.verdict, Extension())
    added = discovery.model.fitted_effects()[len(setup.model.effects) :]
    columns = discovery.model.indices("parameters", setup.parameters)
    values = discovery.model.parameter_values[columns].tolist()
    start = None if discovery.after is None else discovery.after.initial_state
    return Finding(discovery.verdict, Extension(added, dict(zip(setup.parameters, values, strict=True)), start))
