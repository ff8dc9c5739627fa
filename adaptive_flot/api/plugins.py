"""Estimators and controllers from names, classes, and classes with options."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

from adaptive_flot.errors import PluginError
from adaptive_flot.runner.scenario.keys import Plugin

Factory: TypeAlias = Callable[..., Any]
"""A class, or a function that makes an object of one: called with the setup and the options."""
Choice: TypeAlias = str | Factory | tuple[str | Factory, Mapping[str, Any]]
"""A name, a class, or either with options."""
Choices: TypeAlias = Choice | Iterable[Choice] | Mapping[str, Choice]
"""One or several; a mapping gives each the name under which results show it."""


def plugins(given: Choices, find: Callable[[str], Plugin], what: str) -> dict[str, Plugin]:
    """Plug-ins by the name under which results show them.

    Parameters
    ----------
    given
        What the user chose. Without a name of its own, a class shows its `__name__`, and options follow in brackets.
    find
        Plug-in behind a name; options given here go before its own.
    what
        "estimator" or "controller", for messages.

    Raises
    ------
    PluginError
        Neither a name nor a class, options that are no mapping, or one name twice.
    """
    if isinstance(given, Mapping):
        return {name: _plugin(choice, find, what)[1] for name, choice in given.items()}
    several = given if isinstance(given, Iterable) and not isinstance(given, str | tuple | type) else _one(given)
    found: dict[str, Plugin] = {}
    for choice in several:
        name, plugin = _plugin(choice, find, what)
        if name in found:
            raise PluginError(f"{what} {name!r} is given twice; give each once, or names of your own: {{'mine': ...}}")
        found[name] = plugin
    return found


def _one(given: Any) -> Iterable[Choice]:
    """A tuple is a choice with options if its second part is a mapping, else several choices."""
    if isinstance(given, tuple) and not (len(given) == 2 and isinstance(given[1], Mapping)):
        return given
    return (given,)


def _plugin(choice: Any, find: Callable[[str], Plugin], what: str) -> tuple[str, Plugin]:
    use, options = choice if isinstance(choice, tuple) and len(choice) == 2 else (choice, {})
    if not isinstance(options, Mapping):
        raise PluginError(f"{what} {use!r}: options {options!r} are no mapping; give (class, {{'option': value}})")
    told = ", ".join(f"{key}={value!r}" for key, value in options.items())
    suffix = f" ({told})" if told else ""
    if isinstance(use, str):
        plugin = find(use)
        return use + suffix, plugin.with_options(options) if options else plugin
    if not callable(use):
        raise PluginError(f"{what} {use!r} is a {type(use).__name__}; give a name, a class, or (class, options)")
    plugin = Plugin.of(use, options)
    return plugin.use + suffix, plugin
