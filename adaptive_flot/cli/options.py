"""Options that several commands share, and what they come to."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path
from typing import Annotated, TypeVar

import typer

T = TypeVar("T")

Out = Annotated[Path | None, typer.Option("--out", help="Folder of the results; default results/<name>/<command>.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the summary here too.")]


def _file_here(model: str) -> str:
    """A model file of this folder goes before one of that name beside the data."""
    return str(Path(model).resolve()) if Path(model).is_file() else model


ModelOption = Annotated[
    str,
    typer.Option(
        "--model",
        callback=_file_here,
        help="flotation, cascaded-tanks, zinc-level, iron-columns, a model file (YAML), or my_file:make_model.",
    ),
]
CellOption = Annotated[str | None, typer.Option("--cell", help="Cell file (YAML), or the name of a shipped one.")]
MapOption = Annotated[
    Path | None,
    typer.Option("--map", help="From the tags of an export to the model's quantities (YAML); see `import`."),
]
Compile = Annotated[
    bool, typer.Option("--compile", help="Step and estimators as machine code, by the C compiler of this system.")
]


def can_compile(asked: bool) -> bool:
    """Whether to compile; where it is asked for and nothing can be compiled, one line says why."""
    if not asked:
        return False
    from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem

    problem = compiler_problem()
    if problem is not None:
        sys.stderr.write(f"adaptive-flot: --compile: {problem}; going on without, the results are the same\n")
    return problem is None


def ignore_unknown_backend() -> None:
    """Go on without an `MPLBACKEND` that matplotlib does not know: reports need none, and importing it would fail."""
    backend = os.environ.pop("MPLBACKEND", "")
    if not backend:
        return
    import matplotlib

    try:
        matplotlib.rcParams["backend"] = backend
        os.environ["MPLBACKEND"] = backend  # for processes that are started from here
    except ValueError:
        sys.stderr.write(f"adaptive-flot: MPLBACKEND={backend} is no backend of matplotlib; going on without it\n")


def results_folder(out: Path | None, name: str, command: str) -> Path:
    """Folder of a command's results: no two commands share one, so that none overwrites what another wrote."""
    return out or Path("results") / name / command


def once(given: list[T] | None) -> list[T]:
    """What a repeatable option was given, each once."""
    return list(dict.fromkeys(given or ()))


def command_line() -> str:
    """The command as it was typed, for reports."""
    return shlex.join(["adaptive-flot", *sys.argv[1:]])
