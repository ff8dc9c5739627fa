"""Discovery on a file: read the record, run the search, write verdict and extended model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.tables import Source
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.rescaled import factors_as_effects
from adaptive_flot.processes.model_file import is_model_file
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.processes.registry import read_measurements
from adaptive_flot.records.tag_map import TagMap


def discover_file(
    path: Source,
    model: Model,
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
    tag_map: TagMap | None = None,
    processes: int = 1,
    budget: float | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Discovery:
    """Read a measured record and find what physical effect the model lacks.

    Parameters
    ----------
    path
        CSV or Parquet file, or a table.
    model
        The model, with sites.
    limits
        Ranges of inputs by name for the test that is proposed.
    tag_map
        From the tags of an export to the model's quantities.
    processes
        Fits that run at once.
    budget
        Seconds after which the search ends with what it has come to.
    progress
        Called with a word for each stage and each fit.

    Raises
    ------
    DataError, RangeError, ModelError
        The table or the model can not be used; no output in it.
    """
    measured = read_measurements(path, model, tag_map=tag_map)
    if not measured.record.measured(model):  # refused as `estimate` does, where no output has a column at all
        measured = read_measurements(path, model, required_outputs=(model.outputs[0].name,), tag_map=tag_map)
    return discover(
        model,
        measured.record,
        report_record=measured.validation,
        limits=limits,
        processes=processes,
        budget=budget,
        progress=progress,
    )


def read_limits(given: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Ranges of inputs from `input=low:high`.

    >>> read_limits(["air_flow=0.0009:0.0022"])
    {'air_flow': (0.0009, 0.0022)}

    Raises
    ------
    ModelError
        Not of that form, or an input given twice.
    """
    ranges = {}
    for text in given:
        name, _, ends = text.partition("=")
        if name in ranges:
            raise ModelError(f"--limit: {name!r} is given twice; give one range an input")
        low, _, high = ends.partition(":")
        try:
            ranges[name] = (float(low), float(high))
        except ValueError:
            raise ModelError(
                f"--limit: {text!r}; write input=low:high in SI units, as air_flow=0.0009:0.0022"
            ) from None
    return ranges


def check_model_path(path: Path | None) -> None:
    """Refuse the name of a file that could not be written, before the search and not after it.

    Raises
    ------
    ModelError
        Not the name of a model file.
    """
    if path is not None and not is_model_file(path.name):
        raise ModelError(f"--save-model: {path}: a model file ends in .yaml; give such a name")


def save_discovered(
    discovery: Discovery, data: Path, path: Path, *, base: str, cell: str | None, folder: Path | None
) -> bool:
    """Write the extended (else the fitted) model as a model file; False where nothing was fitted.

    `base`, `cell` and `folder` are what the model was made from, see `save_model`.
    """
    if discovery.before is None:
        return False
    note = f"discovered in {data.name}: {discovery.verdict.word}"
    save_model(factors_as_effects(discovery.model), path, base=base, cell=cell, folder=folder, note=note)
    return True
