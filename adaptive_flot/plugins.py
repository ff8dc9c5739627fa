"""Load a class or function by address: a short shipped name, or `module:attribute` of a user's own file."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from adaptive_flot.errors import PluginError, near_match

# Addresses, not imports: the core never imports a plug-in.
ESTIMATORS: Mapping[str, str] = {
    "fixed": "estimators.fixed:Fixed",
    "rpem": "estimators.rpem:Rpem",
}
BATCH_ESTIMATORS: Mapping[str, str] = {"pem": "estimators.pem:Pem"}
CONTROLLERS: Mapping[str, str] = {"schedule": "controllers.schedule:Schedule"}


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
    module_name, attribute = full.split(":", 1)
    module_name = module_name.removesuffix(".py").replace("/", ".").strip(".")
    for place in (folder, Path.cwd()):
        if place is not None and str(place) not in sys.path:
            sys.path.append(str(place))
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        raise PluginError(
            f"{what} {address!r}: no module {error.name!r}; put {module_name}.py beside the file that names it or here"
        ) from error
    except Exception as error:
        raise PluginError(
            f"{what} {address!r}: importing {module_name!r} failed: {type(error).__name__}: {error}"
        ) from error
    if not hasattr(module, attribute):
        names = [n for n in vars(module) if not n.startswith("_")]
        raise PluginError(
            f"{what} {address!r}: module {module_name!r} has no {attribute!r}; {near_match(attribute, names)}"
        )
    return getattr(module, attribute)


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
