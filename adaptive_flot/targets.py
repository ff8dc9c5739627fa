"""What a command or a result will write, checked before any work.

Nothing that was read is overwritten, and all can be written.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from adaptive_flot.errors import OutputError
from adaptive_flot.files import check_writable
from adaptive_flot.plugins import module_file

if TYPE_CHECKING:  # imported by the commands, late
    from adaptive_flot.runner.scenario.keys import Plugin
    from adaptive_flot.runner.scenario.scenario import Scenario

Identity = tuple[int, int] | str

NO_TABLES = ("--json", "--report")
"""Options whose file is neither a table, nor settings, nor a module: they replace none, also where it was not read."""
OTHER_SUFFIXES = (".csv", ".gz", ".parquet", ".py", ".yaml", ".yml")
"""Ends of names of these."""


def check_targets(inputs: Iterable[Path | None], targets: Iterable[tuple[str, Path | None]]) -> None:
    """Check what will be written. Nothing is made or changed.

    Parameters
    ----------
    inputs
        Files that are or were read; None and what does not exist count for nothing.
    targets
        Option or function, and file, for each file that will be written; None where the option was not given.

    Raises
    ------
    OutputError
        A target is an input, under whatever path, or another target; it can not be written, or it is there and a
        table, settings or a module, for an option of NO_TABLES.
    """
    read = {_identity(path): path for path in inputs if path is not None and path.is_file()}
    taken: dict[Identity, str] = {}
    for option, path in targets:
        if path is None:
            continue
        check_writable(path, option)
        identity = _identity(path)
        if identity in read:
            raise OutputError(f"{option}: {path} is an input ({read[identity]}) and would be lost; give another path")
        if option in NO_TABLES and path.suffix.lower() in OTHER_SUFFIXES and path.exists():
            raise OutputError(f"{option}: {path} is there, and a table, settings or a module; give another path")
        if identity in taken:
            raise OutputError(f"{option}: {path} is written by {taken[identity]} already; give another path")
        taken[identity] = option


def check_new(path: Path, option: str, text: str) -> None:
    """Check that a file which a person edits is not there yet, unless it holds what would be written.

    Raises
    ------
    OutputError
        It is there, and holds something else.
    """
    if path.is_file() and path.read_bytes() != text.encode():
        raise OutputError(f"{option}: {path} is there already; give another path, or remove it yourself")


def _identity(path: Path) -> Identity:
    """The same for all paths to one file: links, also hard ones, and other spellings."""
    if not path.exists():
        return os.path.realpath(path)
    status = path.stat()
    return status.st_dev, status.st_ino


def in_folder(folder: Path, *names: str) -> list[tuple[str, Path]]:
    """Targets below the folder of the results."""
    return [("--out", folder / name) for name in names]


def model_inputs(model: str, cell: str | None, folder: Path, plugins: Iterable[str] = ()) -> list[Path]:
    """Files from which a model and plug-ins given by address are read."""
    from adaptive_flot.processes.registry import model_files

    files = (module_file(name.rpartition(":")[0], folder) for name in plugins if ":" in name)
    return [*model_files(model, cell=cell, folder=folder), *(file for file in files if file is not None)]


def scenario_inputs(scenario: Scenario, *plugins: Mapping[str, Plugin] | Iterable[str]) -> list[Path]:
    """Files from which a scenario is read, with the plug-ins that run on it."""
    file = scenario.file
    addresses = [p.use for p in (*file.estimators.values(), *file.controllers.values())]
    for given in plugins:
        addresses += [p.use for p in given.values()] if isinstance(given, Mapping) else list(given)
    folder = scenario.path.parent
    plant = [] if file.plant.cell is None else model_inputs(file.model, file.plant.cell, folder)
    records = [path for profile in scenario.recorded.values() for path in profile.paths(folder)]
    return [scenario.path, *records, *model_inputs(file.model, file.cell, folder, addresses), *plant]
