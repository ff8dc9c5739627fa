"""What a study folder remembers of its grid, and whether a study may go on in it: the grid may grow, not change."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from adaptive_flot.errors import StudyError
from adaptive_flot.files import write_text
from adaptive_flot.studies.grid import Combination, Grid

MANIFEST = "study.json"
WAYS_OUT = "restore the study, or give another --out"


def remember(folder: Path, grid: Grid) -> None:
    """Write the grid of a study into its folder, after `check_grid`."""
    check_grid(folder, grid)
    write_text(folder / MANIFEST, json.dumps(_plain(grid), indent=1) + "\n")


def check_grid(folder: Path, grid: Grid) -> None:
    """Check that every run of the grid that a folder remembers is still in the grid of the study.

    Raises
    ------
    StudyError
        The folder holds results of another study, or of this one before it was changed: says what changed.
    """
    file = folder / MANIFEST
    if file.is_file():
        _check(folder, _read(file), grid)
    elif (folder / "runs.parquet").is_file() or list((folder / "parts").glob("*.parquet")):
        raise StudyError(f"{folder}: results without {MANIFEST}, so nobody knows of what study; give another --out")


def _plain(grid: Grid) -> dict[str, Any]:
    return {
        "options": dict(grid.options),
        "cases": [
            {"scenario": c.scenario, "controller": c.controller, "estimator": c.estimator, "hashes": dict(c.hashes)}
            for c in grid.cases
        ],
        "seeds": list(grid.seeds),
    }


def _read(file: Path) -> Grid:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        cases = tuple(
            Combination(c["scenario"], c["controller"], c["estimator"], c["hashes"]) for c in content["cases"]
        )
        return Grid(cases, tuple(content["seeds"]), content["options"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StudyError(f"{file}: not the memory of a study ({error!r}); give another --out") from error


def _check(folder: Path, old: Grid, new: Grid) -> None:
    for name, value in old.options.items():
        if new.options.get(name) != value:
            raise StudyError(
                f"{folder}: holds results with {name} = {value}, now it is {new.options.get(name)}; "
                "results of both do not mix: give another --out"
            )
    known = {(c.scenario, c.controller, c.estimator): c for c in new.cases}
    for case in old.cases:
        names = (case.scenario, case.controller, case.estimator)
        if names not in known:
            raise StudyError(f"{folder}: holds runs of {', '.join(names)}, which is no longer in the study; {WAYS_OUT}")
        changed = [kind for kind, value in case.hashes.items() if known[names].hashes.get(kind) != value]
        if changed:
            raise StudyError(f"{folder}: {_described(case, changed)} since its runs were made; {WAYS_OUT}")
    gone = set(old.seeds) - set(new.seeds)
    if gone:
        raise StudyError(f"{folder}: holds seeds that are no longer in the study ({_few(sorted(gone))}); {WAYS_OUT}")


def _described(case: Combination, changed: Sequence[str]) -> str:
    names = {"scenario": case.scenario, "controller": case.controller, "estimator": case.estimator}
    what = " and ".join(f"{kind} {names[kind]!r}" for kind in changed if kind in names)
    return f"{what} (content, options or code) has changed"


def _few(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:3])) + (f", ... {len(numbers)} in all" if len(numbers) > 3 else "")
