"""Values of a map file: durations, units, zones, forms of time, bad codes. Each is checked as it is read."""

from __future__ import annotations

from typing import Annotated
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, BeforeValidator

from adaptive_flot.errors import DataError
from adaptive_flot.records.units import read_unit, seconds

FORMATS = ("iso", "day-first", "month-first", "epoch s", "epoch ms", "excel", "seconds", "minutes", "hours")
"""Forms of a time; the last three count from the start of the record."""


def _duration(text: object) -> object:
    if not isinstance(text, str):
        raise ValueError("a duration has a unit; write it as 10 s, 5 min or 1 h")
    try:
        value = seconds(text)
    except DataError as error:
        raise ValueError(str(error)) from error
    if not 0 < value < 1e9:
        raise ValueError("a duration is longer than nothing")
    return text


def _unit(text: str) -> str:
    try:
        read_unit(text)
    except DataError as error:
        raise ValueError(str(error)) from error
    return text


def _zone(name: str) -> str:
    try:
        ZoneInfo(name)
    except (LookupError, ValueError, OSError) as error:
        raise ValueError("no time zone; write one as Europe/London, or UTC") from error
    return name


def _form(text: str) -> str:
    if text not in FORMATS and "%" not in text:
        raise ValueError(f"no form of time; write one of {', '.join(FORMATS)}, or one as '%d.%m.%Y %H:%M'")
    return text


def _codes(given: object) -> object:
    """Texts and numbers, one or a list of them, as texts."""
    listed = given if isinstance(given, (list, tuple)) else [given]
    return [str(v) if isinstance(v, (int, float)) and not isinstance(v, bool) else v for v in listed]


Duration = Annotated[str, BeforeValidator(_duration)]
Codes = Annotated[tuple[str, ...], BeforeValidator(_codes)]
UnitText = Annotated[str, AfterValidator(_unit)]
Zone = Annotated[str, AfterValidator(_zone)]
TimeForm = Annotated[str, AfterValidator(_form)]
