"""The errors a user can cause. Each message says what is wrong, where, what was got and what to do.

Numerical outcomes (a failed solve, a missing measurement) are never errors: they are `Status` values.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class AdaptiveFlotError(Exception):
    """Root of every error that a user's input can cause; the command line prints it and exits with 2."""


class DataError(AdaptiveFlotError):
    """A table can not be used: missing column, wrong unit, gap, text, unordered time, empty file."""


class ScenarioError(AdaptiveFlotError):
    """A scenario file can not be used: unknown key, wrong type, value outside its range."""


class CellError(AdaptiveFlotError):
    """A cell file can not be used: missing entry, missing unit, value outside its physical range."""


class ModelError(AdaptiveFlotError):
    """A model is used wrongly: unknown name, wrong shape, an equation that is missing or given twice."""


class RangeError(AdaptiveFlotError):
    """A quantity leaves the range in which the model means anything: level above the cell, negative flow."""


class OutputError(AdaptiveFlotError):
    """A result can not be written: folder missing, no permission, a folder where a file should be."""


class ResultError(AdaptiveFlotError):
    """Results can not be compared: none there, not written by this program, or of scenarios that differ."""


class StudyError(AdaptiveFlotError):
    """A study can not be run: wrong study file, results of another study in its folder, cluster lost."""


class PluginError(AdaptiveFlotError):
    """An estimator, controller or model named in a file or on the command line can not be loaded."""


class LinkError(AdaptiveFlotError):
    """A link to a plant can not be used: wrong link file, certificate or password, no such tag, port in use."""


@contextmanager
def located(where: object) -> Iterator[None]:
    """Put the place (a file) in front of the message of every error raised inside, unless it is there already."""
    try:
        yield
    except AdaptiveFlotError as error:
        text = str(error)
        if text.startswith(str(where)):
            raise
        raise type(error)(f"{where}: {text}") from error


def near_match(name: str, known: Iterable[str], what: str = "known") -> str:
    """Return the hint that ends a message on an unknown name; `what` says which names are listed.

    >>> near_match("rpm", ["rpem", "fixed"])
    "did you mean 'rpem'? Known: fixed, rpem"
    >>> near_match("x", ["rpem", "fixed"])
    'known: fixed, rpem'
    """
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=1)
    listing = f"{what}: {', '.join(names)}"
    return f"did you mean '{close[0]}'? {listing[:1].upper()}{listing[1:]}" if close else listing
