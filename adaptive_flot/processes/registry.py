"""The shipped processes by name, a user's own as `module:factory`, and model files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from adaptive_flot.errors import CellError, ModelError, PluginError, located, near_match
from adaptive_flot.greybox.data.dataset import TIME_COLUMN, read_dataset
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.model import Model
from adaptive_flot.plugins import construct, load, module_file
from adaptive_flot.processes import cascaded_tanks, flotation, iron_columns, zinc_level
from adaptive_flot.processes.model_file import find_model_file, is_model_file, load_model_file
from adaptive_flot.processes.process import Measurements
from adaptive_flot.records.importing import is_record, read_with_map
from adaptive_flot.records.tag_map import TagMap
from adaptive_flot.resources import cell_file

WITHOUT_CELL = {p.name: p for p in (cascaded_tanks.PROCESS, zinc_level.PROCESS, iron_columns.PROCESS)}
PROCESSES = ("flotation", *WITHOUT_CELL)


def make_model(name: str = "flotation", *, cell: str | None = None, folder: Path | None = None) -> Model:
    """Model of a process.

    Parameters
    ----------
    name
        `flotation`, another of `PROCESSES`, `module:factory` of a function without arguments that returns a `Model`, or
        the path of a model file (relative to `folder` or to here).
    cell
        Cell file for the flotation model: a path (relative to `folder` or to here), or the name of a shipped one.
    folder
        Folder of the file that names the model.

    Raises
    ------
    PluginError
        Unknown name, or the factory does not return a `Model`.
    CellError
        The cell file can not be used, or the process takes none.
    ModelError, RangeError
        The model file can not be used.
    """
    if is_model_file(name):
        return _read(find_model_file(name, folder), cell)
    if name == "flotation":
        return flotation.make_model(flotation.read_cell(find_cell(cell, folder)))
    if name not in PROCESSES and ":" not in name:
        if name.endswith(".py"):
            raise PluginError(f"model {name!r}: which function of that file makes it? Write {name}:make_model")
        if name in _shipped_cells():
            raise PluginError(f"{name!r} is a cell of the model 'flotation', and no model; give it by --cell {name}")
        known = near_match(name, PROCESSES)
        raise PluginError(f"unknown model {name!r}; {known}, or a model file, or your own as my_file:make_model")
    if cell is not None:
        raise CellError(f"model {name!r} takes no cell file; leave 'cell' out")
    if name in WITHOUT_CELL:
        return WITHOUT_CELL[name].make_model()
    try:
        model = construct(load(name, {}, "model", folder), name, "model")
    except ModelError as error:
        raise ModelError(f"model {name!r}: {error}") from error
    if not isinstance(model, Model):
        raise PluginError(f"model {name!r}: the factory returned a {type(model).__name__}; return a Model")
    return model


def read_measurements(
    source: Source, model: Model, *, required_outputs: Sequence[str] = (), tag_map: TagMap | None = None
) -> Measurements:
    """Read a measured record: a table with the model's columns, a published file of a shipped process, or an export.

    Parameters
    ----------
    source
        File, or table at hand.
    model
        The model.
    required_outputs
        Outputs that a table with the model's columns must have.
    tag_map
        From the tags of an export to the model's quantities; a table that is a record already needs none.

    Raises
    ------
    DataError, RangeError
        The table can not be used.
    """
    if tag_map is not None and not is_record(source, model):
        with located(named(source)):
            record = read_dataset(read_with_map(source, model, tag_map), model, required_outputs=required_outputs)
        return Measurements(replace(record, name=named(source).stem))
    if model.name in WITHOUT_CELL and TIME_COLUMN not in read_table(source).columns:
        return WITHOUT_CELL[model.name].read_published(source)
    return Measurements(read_dataset(source, model, required_outputs=required_outputs))


def _read(path: Path, cell: str | None) -> Model:
    if cell is not None:
        raise CellError(f"{path}: a model file names its cell itself; leave 'cell' out, or write it there")
    file = load_model_file(path)
    beside = path.parent / file.cell if file.cell else None
    with located(path):
        own_cell = str(beside) if beside is not None and beside.is_file() else file.cell
        return file.extend(make_model(file.model, cell=own_cell, folder=path.parent))


def model_files(name: str, *, cell: str | None = None, folder: Path | None = None) -> list[Path]:
    """Files from which `make_model` reads a model: model file, cell file, a user's own module.

    Raises
    ------
    ModelError, CellError
        There is no such file, or the model file can not be read.
    """
    if is_model_file(name):
        path = find_model_file(name, folder)
        file = load_model_file(path)
        return [path, *model_files(file.model, cell=file.cell, folder=path.parent)]
    if name == "flotation":
        return [find_cell(cell, folder)]
    module = module_file(name.rpartition(":")[0], folder) if ":" in name else None
    return [] if module is None else [module]


def find_cell(cell: str | None, folder: Path | None = None) -> Path:
    """Path of a cell file, given as path or shipped name (default: the laboratory cell)."""
    if cell is None:
        return cell_file()
    for place in (Path(cell), *([folder / cell] if folder else []), cell_file(cell)):
        if place.is_file():
            return place
    raise CellError(f"{cell}: no such cell file; {near_match(cell, _shipped_cells(), 'shipped')}")


def _shipped_cells() -> list[str]:
    return [f.stem for f in cell_file().parent.glob("*.yaml")]
