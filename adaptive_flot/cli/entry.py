"""The entry point: every error becomes one line on standard error and an exit code."""

from __future__ import annotations

import signal
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import typer
from pydantic import ValidationError

from adaptive_flot.child_processes import Terminated, asked_to_end, terminable
from adaptive_flot.cli.commands import app
from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.plugins import plugin_failure
from adaptive_flot.yaml_files.problems import in_words

DEFECT = 1
USER_ERROR = 2
DEBUG = "--debug"
UsageError: Any = typer.BadParameter.__mro__[1]
"""Of the library that typer has in it, which gives it no public name."""
OWN = ("adaptive_flot", "estimators", "controllers")
"""Packages of this program."""


def main() -> None:
    """Run the command line.

    Exit codes: 0 done, 1 a defect of this program, 2 a mistake of the user, 130 interrupted. A program that a signal
    ended gives 128 and the number of the signal.
    """
    # where equations call NumPy on a model's quantities, which is right: a page of text, with every run
    warnings.filterwarnings("ignore", r"\s*casadi: a numpy function", FutureWarning)
    arguments, debug = _debug_first(sys.argv[1:])
    with terminable():
        try:
            sys.exit(app(arguments, standalone_mode=False) or 0)
        except UsageError as error:
            _end_usage(error, debug)
        except typer.Abort as error:  # at a question
            _end_by(error, asked_to_end() or signal.SIGINT, debug)
        except KeyboardInterrupt as error:
            _end_by(error, signal.SIGINT, debug)
        except Terminated as end:
            _end_by(end, end.number, debug)
        except AdaptiveFlotError as error:
            _end(error, str(error), USER_ERROR, debug)
        except MemoryError as error:
            _end(error, "not enough memory; give a shorter record, or fewer processes", DEFECT, debug)
        except (Exception, SystemExit) as error:
            number = asked_to_end()
            if number is not None and not isinstance(error, SystemExit):
                _end_by(error, number, debug)  # what a handler raised, as a library handed it on
            failure = plugin_failure(error)
            if failure is not None:
                _end(error, str(failure), USER_ERROR, debug)
            if isinstance(error, SystemExit):
                raise
            hint = "report it" if debug else f"run it again with {DEBUG} and report what it prints"
            _end(error, f"a defect of this program ({_place(error)}): {_described(error)}; {hint}", DEFECT, debug)


def _end_usage(error: Any, debug: bool) -> NoReturn:
    """What the options and arguments have wrong, as one line; a command that was given nothing shows its help."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        sys.exit(USER_ERROR)
    command = error.ctx.info_name if error.ctx is not None and error.ctx.parent is not None else ""
    text = " ".join(error.format_message().split()).rstrip(".")
    if isinstance(error.__cause__, ValidationError):
        problem = error.__cause__.errors()[0]
        text = text.replace(error.message, f"{in_words(problem)}, got {problem['input']!r}").replace(
            ": Input", ": input"
        )
    where = f"{command}: " if command else ""
    shown = f"adaptive-flot {command}".strip()
    _end(error, f"{where}{text[:1].lower()}{text[1:]}; see '{shown} --help'", USER_ERROR, debug)


def _debug_first(given: Sequence[str]) -> tuple[list[str], bool]:
    """Arguments with `--debug`, which may stand anywhere, before the command."""
    end = given.index("--") if "--" in given else len(given)
    if DEBUG not in given[:end]:
        return list(given), False
    return [DEBUG, *(a for a in given[:end] if a != DEBUG), *given[end:]], True


def _end(error: BaseException, message: str, code: int, debug: bool) -> NoReturn:
    if debug:
        traceback.print_exception(error)
    sys.stderr.write(f"adaptive-flot: {' '.join(message.split())}\n")
    sys.exit(code)


def _end_by(error: BaseException, number: signal.Signals, debug: bool) -> NoReturn:
    """End as a signal asks for. Ctrl-C needs no words: who pressed it knows."""
    if number == signal.SIGINT:
        sys.exit(128 + number)
    said = f"ended by {number.name}"
    if next((word for word in sys.argv[1:] if not word.startswith("-")), "") == "discover":
        said += "; nothing is told. With --budget SECONDS a search ends by itself, and tells what it has come to"
    _end(error, said, 128 + number, debug)


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _place(error: BaseException) -> str:
    """File and line of the innermost frame of this program, as `adaptive_flot/files.py, line 12`."""
    root = Path(__file__).parents[2]
    frames = [(Path(f.filename), f.lineno) for f in traceback.extract_tb(error.__traceback__)]
    inside = [(f.relative_to(root), line) for f, line in frames if f.is_relative_to(root)]
    own = [(f, line) for f, line in inside if f.parts[0] in OWN]
    file, number = own[-1]
    return f"{file.as_posix()}, line {number}"
