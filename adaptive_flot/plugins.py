"""Load a class or function by address: a short shipped name, or `module:attribute` of a user's own file."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from adaptive_flot.errors import PluginError, near_match

# Addresses, not imports: the core never imports a plug-in.
ESTIMATORS: Mapping[str, str] = {
    "ekf": "estimators.ekf:Ekf",
    "fixed": "estimators.fixed:Fixed",
    "imm": "estimators.imm:Imm",
    "mhe": "estimators.mhe:Mhe",
    "oracle": "estimators.oracle:Oracle",
    "rpem": "estimators.rpem:Rpem",
    "rpem_full": "estimators.rpem:rpem_full",
}
BATCH_ESTIMATORS: Mapping[str, str] = {"pem": "estimators.pem:Pem"}
CONTROLLERS: Mapping[str, str] = {
    "economic_mpc": "controllers.economic_mpc:EconomicMpc",
    "hold": "controllers.hold:Hold",
    "pi": "controllers.pi:Pi",
    "schedule": "controllers.schedule:Schedule",
}


def load(address: str, shipped: Mapping[str, str], what: str, folder: Path | None = None) -> Any:
    """Return the object behind a short name or `module:attribute`.

    Parameters
    ----------
    address
        Short name, or the module (its name, or the path of its file) and the attribute, separated by a colon.
    shipped
        Short names and their addresses.
    what
        What is loaded, for messages: "estimator", "controller", "model".
    folder
        Folder in which a user's module may lie, beside the current one.

    Raises
    ------
    PluginError
        Unknown name (with the nearest one), no such module, no such attribute, or the module fails on import.
    """
    full = shipped.get(address, address)
    if ":" not in full:
        raise PluginError(f"unknown {what} {address!r}; {near_match(address, shipped)}, or your own as my_file:MyClass")
    module_name, attribute = full.rsplit(":", 1)
    try:
        module = _import(module_name, folder)
    except ModuleNotFoundError as error:
        stem = Path(module_name).stem
        raise PluginError(
            f"{what} {address!r}: no module {error.name!r}; put {stem}.py beside the file that names it or here"
        ) from error
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise PluginError(f"{what} {address!r}: importing {module_name!r} failed: {reason}; correct it") from error
    if not hasattr(module, attribute):
        names = [n for n in vars(module) if not n.startswith("_")]
        raise PluginError(
            f"{what} {address!r}: module {module_name!r} has no {attribute!r}; {near_match(attribute, names)}"
        )
    return getattr(module, attribute)


def _import(name: str, folder: Path | None) -> ModuleType:
    """Import a module by the path of its file, by name beside the file that names it, or as an installed one."""
    file = module_file(name, folder)
    if file is not None:
        return _import_file(file.resolve())
    if name.endswith(".py") or "/" in name:
        raise ModuleNotFoundError(name, name=name)
    return importlib.import_module(name)


def module_file(name: str, *folders: Path | None) -> Path | None:
    """File of a user's module, in one of the folders or here; None for an installed one."""
    for place in (*folders, Path.cwd()):
        file = (place or Path()) / f"{name.removesuffix('.py')}.py"
        if place is not None and file.is_file():
            return file
    return None


def _import_file(file: Path) -> ModuleType:
    """Import a file under its own stem, so that its states can be pickled; another file of that name is replaced."""
    known = sys.modules.get(file.stem)
    if known is not None and getattr(known, "__file__", None) == str(file):
        return known
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(str(file), name=str(file))
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[file.stem]
        raise
    return module


def construct(factory: Any, address: str, what: str, *arguments: Any, **options: Any) -> Any:
    """Call a plug-in's constructor; a wrong option becomes a one-line error.

    Raises
    ------
    PluginError
        The constructor does not take the options given.
    """
    try:
        return factory(*arguments, **options)
    except TypeError as error:
        given = ", ".join(f"{k}={v!r}" for k, v in options.items()) or "no options"
        raise PluginError(f"{what} {address!r} can not be made with {given}: {error}") from error
