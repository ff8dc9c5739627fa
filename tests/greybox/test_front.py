"""Protects: the front of the engine is complete and sorted, and `help()` of what it offers explains every field."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path

import pytest

from adaptive_flot import greybox

CLASSES = [getattr(greybox, name) for name in greybox.__all__ if inspect.isclass(getattr(greybox, name))]
DATACLASSES = [c for c in CLASSES if dataclasses.is_dataclass(c)]


def documented(section: str, doc: str) -> set[str]:
    """Names in a numpy-style section: the lines of its first column, names parted by commas."""
    found = re.search(rf"^{section}\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", inspect.cleandoc(doc), re.S | re.M)
    lines = found[1].splitlines() if found else []
    return {name.strip() for line in lines if line and not line.startswith(" ") for name in line.split(",")}


@pytest.mark.parametrize("kind", DATACLASSES, ids=lambda c: c.__name__)
def test_every_field_is_explained_in_help(kind: type) -> None:
    """No more and no fewer names than fields, so that a renamed field takes its explanation along."""
    fields = {f.name for f in dataclasses.fields(kind) if not f.name.startswith("_")}
    assert documented("Attributes", kind.__doc__ or "") == fields


def test_every_exported_name_is_there_and_has_a_docstring() -> None:
    assert greybox.__all__ == sorted(set(greybox.__all__))
    for name in greybox.__all__:
        assert hasattr(greybox, name)
        if name != "FloatArray":  # an alias of a type
            assert inspect.getdoc(getattr(greybox, name)), name


def test_the_map_names_every_module_and_folder_of_the_engine() -> None:
    """A stranger finds a file by the map: none is left out and none is there that is not."""
    folder = Path(greybox.__file__).parent
    there = {p.name for p in folder.glob("*.py")} - {"__init__.py"}
    there |= {f"{p.name}/" for p in folder.iterdir() if (p / "__init__.py").is_file()}
    named = set(re.findall(r"^(\w+(?:\.py|/)) ", greybox.__doc__ or "", re.M))
    assert named == there
