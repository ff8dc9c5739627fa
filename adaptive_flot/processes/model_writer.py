"""Write a model as a model file, so that `run`, `estimate`, `discover` and the MPC can use it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from adaptive_flot.errors import ModelError
from adaptive_flot.files import replace_file
from adaptive_flot.greybox.model import Model
from adaptive_flot.plugins import module_file
from adaptive_flot.processes.effect_entry import as_entry
from adaptive_flot.processes.model_file import find_model_file, is_model_file, load_model_file
from adaptive_flot.processes.registry import find_cell, make_model
from adaptive_flot.resources import cell_file


def save_model(
    model: Model,
    path: Path | str,
    *,
    base: str = "flotation",
    cell: str | None = None,
    folder: Path | None = None,
    note: str = "",
) -> None:
    """Write a model as a model file, whole or not at all; read again, its trajectories are the same to the bit.

    The file holds the name of the process, the parameters whose values differ from the process's own, and all effects
    with their present coefficients. Paths in it are relative to its folder.

    Parameters
    ----------
    model
        The process of `base` with other parameter values and with effects.
    path
        The file to write, `.yaml`.
    base, cell, folder
        What `make_model` made the process from; `base` may be a model file too.
    note
        Where the changes come from: kept in the file, and as the source of each changed parameter.

    Raises
    ------
    ModelError
        The model is not that of `base` with effects, or the path is not a YAML file's.
    OutputError
        The file can not be written.
    """
    file = Path(path)
    if not is_model_file(file.name):
        raise ModelError(f"{file}: a model file ends in .yaml; give such a name")
    base, cell, folder = _process(base, cell, folder)
    process, own = make_model(base, cell=cell, folder=folder), model.without_effects()
    if any(process.names(kind) != own.names(kind) for kind in ("states", "inputs", "parameters", "outputs")):
        raise ModelError(
            f"{file}: model '{model.name}' is not {base!r} with effects; name the process it was made from"
        )
    content: dict[str, Any] = {"note": note} if note else {}
    content["model"] = _relative_module(base, folder, file.parent)
    if base == "flotation":
        content["cell"] = _relative_cell(cell, folder, file.parent)
    changed = [(p, q) for p, q in zip(own.parameters, process.parameters, strict=True) if p.value != q.value]
    if changed:
        content["parameters"] = {
            p.name: {"value": float(p.value), "unit": p.unit, "source": p.source if p.source != q.source else note}
            for p, q in changed
        }
    content["effects"] = [as_entry(effect, model) for effect in model.fitted_effects()]
    with replace_file(file) as stream:
        yaml.safe_dump(content, stream, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def _process(base: str, cell: str | None, folder: Path | None) -> tuple[str, str | None, Path | None]:
    """Name, cell and folder of the process under a model file; a process stays as it is."""
    if not is_model_file(base):
        return base, cell, folder
    path = find_model_file(base, folder)
    file = load_model_file(path)
    beside = path.parent / file.cell if file.cell else None
    return file.model, str(beside) if beside is not None and beside.is_file() else file.cell, path.parent


def _relative_cell(cell: str | None, folder: Path | None, to: Path) -> str:
    path = find_cell(cell, folder)
    return path.stem if path.parent == cell_file().parent else _relative(path, to)


def _relative_module(base: str, folder: Path | None, to: Path) -> str:
    name, colon, attribute = base.rpartition(":")
    file = module_file(name, folder) if colon else None
    return base if file is None else f"{_relative(file.with_suffix(''), to)}:{attribute}"


def _relative(path: Path, to: Path) -> str:
    return Path(os.path.relpath(path.resolve(), to.resolve())).as_posix()
