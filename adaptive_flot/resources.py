"""Where the shipped scenarios and cells lie, in a wheel and in an editable install alike."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def scenario_folder() -> Path:
    """Folder of the shipped scenarios: inside the package in a wheel, beside it in a checkout."""
    packed = _PACKAGE / "_scenarios"
    return packed if packed.is_dir() else _PACKAGE.parent / "scenarios"


def cell_file(name: str = "lab_87l") -> Path:
    """Path of a shipped cell file."""
    return scenario_folder() / "cells" / f"{name}.yaml"
