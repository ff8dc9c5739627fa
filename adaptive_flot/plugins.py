"""Load a class or function by address: a short shipped name, or `module:attribute` of a user's own file."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from adaptive_flot.errors import PluginError, near_match

# Addresses, not imports: the core never imports a plug-in.
ESTIMATORS: Mapping[str, str] = {
    "adaptive_imm": "estimators.adaptive_imm:AdaptiveImm",
    "ekf": "estimators.ekf:Ekf",
    "fixed": "estimators.fixed:Fixed",
    "imm": "estimators.imm:Imm",
    "mhe": "estimators.mhe:Mhe",
    "oracle": "estimators.oracle:Oracle",
    "rpem": "estimators.rpem:Rpem",
    "rpem_full": "estimators.rpem:rpem_full",
}
DEFAULT_ESTIMATOR = "adaptive_imm"
"""The estimator that runs where a person names none."""
BATCH_ESTIMATORS: Mapping[str, str] = {"pem": "estimators.pem:Pem"}
OF_A_RECORD = ("fixed", DEFAULT_ESTIMATOR, "pem")
"""What replays a measured record where a person names none: nothing adapted, each sample, and one fit of all."""
CONTROLLERS: Mapping[str, str] = {
    "economic_mpc": "controllers.economic_mpc:EconomicMpc",
    "hold": "controllers.hold:Hold",
    "pi": "controllers.pi:Pi",
    "schedule": "controllers.schedule:Schedule",
}
WITHOUT_A_VALUE = "Cannot compute the truth value of a CasADi"
"""Of what CasADi says where an equation has a condition."""
WITHOUT_A_CONDITION = "write casadi.if_else, fmin, fmax or logic_and in place of if, min, max or and"
METHODS: Mapping[str, tuple[str, ...]] = {
    "estimator": ("init", "update"),
    "controller": ("init", "decide"),
    "batch estimator": ("fit",),
}
"""What a plug-in of a kind must have."""
_user_files: set[str] = set()
"""Files of the plug-ins that a user named, which errors are traced back to."""


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
        reason = _not_there(module_name, error.name or module_name, folder)
        raise PluginError(f"{what} {address!r}: {reason}") from error
    except (Exception, SystemExit) as error:
        file = module_file(module_name, folder)
        place = _place(error, {str(file.resolve())}) if file is not None else None
        reason = f"{type(error).__name__}: {error}" + (f" ({place})" if place else "")
        raise PluginError(f"{what} {address!r}: importing {module_name!r} failed: {reason}; correct it") from error
    if full == address and module.__file__ is not None:
        _user_files.add(module.__file__)
    if not hasattr(module, attribute):
        names = [n for n in vars(module) if not n.startswith("_")]
        raise PluginError(
            f"{what} {address!r}: module {module_name!r} has no {attribute!r}; {near_match(attribute, names)}"
        )
    return getattr(module, attribute)


def _not_there(module: str, missing: str, folder: Path | None) -> str:
    """Why a module could not be imported, and what to do."""
    stem = Path(module).stem
    if module_file(module, folder) is not None:
        return f"{stem}.py imports {missing!r}, which is not there; put it beside {stem}.py, or install it"
    if module.endswith(".py"):
        return f"no file {module}; give its path"
    # a dotted name is that of a package, and not of a file in another folder
    do = f"put {stem}.py beside the file that names it or here" if stem == module else "install it"
    return f"no module {missing!r}; {do}"


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
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))  # it may import its neighbours, also later, as a script may
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
        The constructor does not take the options given, or what it makes is no plug-in of that kind.
    """
    try:
        made = factory(*arguments, **options)
    except TypeError as error:
        if plugin_failure(error) is not None:
            raise  # from inside the constructor of a user
        given = ", ".join(f"{k}={v!r}" for k, v in options.items()) or "no options"
        raise PluginError(
            f"{what} {address!r} can not be made with {given}: {_wrong_option(factory, options) or error}"
        ) from error
    for method in METHODS.get(what, ()):
        if not callable(getattr(made, method, None)):
            kind = "None" if made is None else f"a {type(made).__name__}"
            raise PluginError(f"{what} {address!r} is {kind} without a method {method!r}; write it")
    return made


def _wrong_option(factory: Any, options: Mapping[str, Any]) -> str:
    """A word on the first option that a constructor does not take; empty where it takes all, or does not say."""
    try:
        taken = inspect.signature(factory).parameters
    except (TypeError, ValueError):
        return ""
    if any(p.kind is p.VAR_KEYWORD for p in taken.values()):
        return ""
    wrong = next((name for name in options if name not in taken), None)
    known = [p.name for p in taken.values() if p.default is not p.empty]
    return "" if wrong is None else f"no option '{wrong}'; {near_match(wrong, known)}"


def plugin_failure(error: BaseException, *, full_path: bool = True) -> PluginError | None:
    """The error in one line, where it comes from the code of a plug-in that a user named; else None.

    Without the full path the line is the same on every machine, as the table of a study must be.
    """
    place = _place(error, _user_files, full_path)
    if place is None:
        return None
    said = "ends the program" if isinstance(error, SystemExit) else f"{type(error).__name__}: {error}"
    if WITHOUT_A_VALUE in said:
        return PluginError(f"{place}: what a model computes with has no value yet; {WITHOUT_A_CONDITION}")
    return PluginError(f"{place}: {said}; correct the plug-in")


def _place(error: BaseException, files: Collection[str], full_path: bool = True) -> str | None:
    """File and line of the innermost frame in one of these files."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in files]
    if not frames:
        return None
    file = frames[-1].filename
    return f"{file if full_path else Path(file).name}, line {frames[-1].lineno}"


def method_place(plugin: object, method: str) -> str:
    """File and line of a plug-in's method, for messages on what it returned."""
    code = inspect.unwrap(getattr(type(plugin), method)).__code__
    return f"{code.co_filename}, line {code.co_firstlineno}, {type(plugin).__name__}.{method}"
