"""Turn what pydantic says of a YAML file into one line: key path, what is wrong, nearest known key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from adaptive_flot.errors import near_match

Place = tuple[int | str, ...]
LONGEST_SHOWN = 80
"""Characters of a wrong value that a message repeats."""


def first_problem(error: ValidationError, schema: type[BaseModel]) -> str:
    """Describe the first problem of a file that was validated against a schema."""
    problems = error.errors()
    first = problems[0]
    if first["type"] == "missing":  # perhaps because it is misspelt
        beside = (p for p in problems if p["type"] == "extra_forbidden" and p["loc"][:-1] == first["loc"][:-1])
        first = next(beside, first)
    place = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        known = _known_keys(schema, first["loc"][:-1])
        hint = f"; {near_match(str(first['loc'][-1]), known)}" if known else ""
        return f"unknown key {place!r}{hint}"
    if first["type"] == "missing":
        return f"key {place!r} is missing; add it"
    if first["type"] == "union_tag_invalid":
        context = first["ctx"]
        known = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
        key = context["discriminator"].strip("'()")  # a key, or a function of its name
        return f"{place}: unknown {key} {context['tag']!r}; {near_match(context['tag'], known)}"
    if first["type"] == "union_tag_not_found":
        key = first["ctx"]["discriminator"].strip("'")
        return f"{place}: key {key!r} is missing; it says what kind of entry this is"
    got = first.get("input")
    shown = f", got {_shortened(got)}" if not isinstance(got, dict) else ""
    return f"{place}: {in_words(first)}{shown}; correct it"


def in_words(problem: Mapping[str, Any]) -> str:
    """What one of pydantic's problems says of a value, without the names of classes and of its own steps."""
    kind, context = str(problem["type"]), problem.get("ctx", {})
    if kind == "too_short":
        least = context["min_length"]
        return f"needs at least {least} {'entry' if least == 1 else 'entries'}"
    if kind == "too_long":
        return f"takes at most {context['max_length']} entries"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return "Input should be keys with their values"
    if kind.startswith(("datetime_", "date_")):
        return "Input should be a date with a time, as 2026-11-29T13:00"
    return str(problem["msg"]).removeprefix("Value error, ").split(", unable to parse")[0]


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."


def _known_keys(schema: type[BaseModel], where: Place) -> list[str]:
    """Keys that are allowed at a place of the file."""
    found: type[BaseModel] | None = schema
    for part in where:
        fields = found.model_fields if found is not None else {}
        if part in fields:
            found = _nested(fields[str(part)].annotation, where)
    return [f.alias or name.rstrip("_") for name, f in found.model_fields.items()] if found is not None else []


def _nested(annotation: Any, where: Place) -> type[BaseModel] | None:
    """Model behind an annotation; of several kinds of profiles or faults the one that the path names."""
    candidates = _models(annotation)
    by_kind: dict[str, type[BaseModel]] = {
        str(m.model_fields[key].annotation.__args__[0]): m  # type: ignore[union-attr]
        for m in candidates
        for key in ("profile", "fault")
        if key in m.model_fields
    }
    if len(by_kind) > 1:
        return by_kind.get(str(where[-1]), candidates[0])
    return candidates[0] if candidates else None


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in getattr(annotation, "__args__", ()) for model in _models(argument)]
