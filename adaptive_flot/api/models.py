"""A model from what the user gave: a `Model`, a name, or the address of a file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.model import Model
from adaptive_flot.processes.model_file import is_model_file
from adaptive_flot.processes.model_writer import save_model
from adaptive_flot.processes.registry import PROCESSES, make_model
from adaptive_flot.resources import cell_file
from adaptive_flot.targets import model_inputs

AnyModel: TypeAlias = Model | str | Path
"""A model at hand, or what names one; see `read_model`."""

_NAMES_A_MODEL = re.compile(r"^model\s*:", re.MULTILINE)


@dataclass(frozen=True)
class Origin:
    """Where a model came from, so that a model file can name it.

    Attributes
    ----------
    base
        Name of the process, or the address of the function that makes it; None where only an object was given.
    cell
        Cell file of the flotation model, by path or shipped name.
    """

    base: str | None
    cell: str | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """Files from which the model was read, which no result may overwrite."""
        if self.base is None:
            return ()
        return tuple(path.absolute() for path in model_inputs(self.base, self.cell, Path.cwd()))

    def save(self, model: Model, path: Path | str, note: str, base: str | None = None) -> Path:
        """Write a model made from this origin as a model file.

        Parameters
        ----------
        model
            The process with other parameter values and with effects.
        path
            File to write, `.yaml`.
        note
            Where the changes come from.
        base
            The process, where it is not known from the origin.

        Raises
        ------
        ModelError
            The process is not known, or the model is not that process with effects.
        OutputError
            The file can not be written.
        """
        found = base or self.base
        if found is None:
            raise ModelError(
                f"{path}: model '{model.name}' was given as an object, which a file can not name; "
                "give the function that makes it, as base='my_file:make_model'"
            )
        save_model(model, path, base=found, cell=self.cell, folder=Path.cwd(), note=note)
        return Path(path)


def read_model(given: AnyModel) -> tuple[Model, Origin]:
    """Model behind what the user gave, and where it came from.

    Parameters
    ----------
    given
        A `Model`; the name of a process ("cascaded-tanks") or of a shipped cell ("lab_87l"); the path of a cell file or
        of a model file (YAML); or "my_file:make_model", a function without arguments.

    Raises
    ------
    PluginError, CellError, ModelError, RangeError
        Nothing of that name, or the file can not be used.

    Examples
    --------
    >>> read_model("lab_87l")[0].name
    'flotation'
    """
    if isinstance(given, Model):
        return given, Origin(given.name if given.name in PROCESSES else None)
    name = str(given)
    if _is_cell(name):
        return make_model("flotation", cell=name), Origin("flotation", name)
    return make_model(name), Origin(name)


def _is_cell(name: str) -> bool:
    """Whether a name is that of a cell: a shipped one, or a YAML file that does not say which model it describes."""
    if not is_model_file(name):
        return ":" not in name and cell_file(name).is_file()
    try:
        return not _NAMES_A_MODEL.search(Path(name).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return False  # the reader of model files says what is wrong with it
