"""A search of what was measured in a loop for what its model lacks.

It is apart from the extension itself, which processes take up that never search: discovery and its libraries take a
second or two to load.
"""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.contracts import Setup
from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.runner.adaptation.extension import Extension

TAKEN_UP = ("named", "class")
"""Verdicts that extend a model; discovery gives neither without confirmation on rows that did not enter the search."""


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
