"""Change nested YAML content by dotted paths."""

from __future__ import annotations

from collections.abc import Mapping
from types import EllipsisType
from typing import Any


def edit(content: dict[str, Any], changes: Mapping[str, object]) -> dict[str, Any]:
    """Change entries in place by dotted path (a number counts in a list); `...` deletes, a new path adds."""
    for path, value in changes.items():
        *parents, last = path.split(".")
        entry: Any = content
        for key in parents:
            entry = entry[int(key)] if isinstance(entry, list) else entry[key]
        if isinstance(value, EllipsisType):
            del entry[last]
        else:
            entry[last] = value
    return content
