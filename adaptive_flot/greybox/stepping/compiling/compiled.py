"""CasADi functions as machine code, on request: C through the system's compiler, kept on disk.

CasADi interprets an expression operation by operation. The same operations as C, compiled at -O1 without contraction of
products and sums, give the same numbers several times quicker; higher levels gain nothing on straight-line code and
take the compiler much longer. A library is kept under a hash of source, compiler and flags, in the user's cache folder
(`platformdirs`). It is compiled under another name and then renamed, so any number of processes may want the same one
at once. A library is loaded only where nobody else can have put it (`safe_folder.py`).
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import casadi as ca
from platformdirs import user_cache_path

from adaptive_flot.greybox.stepping.compiling.kept import tidy, used
from adaptive_flot.greybox.stepping.compiling.safe_folder import make_private, problem_of

FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
CACHE_LEVELS = 3
"""Folders above a library that are checked: its own, that of the project, and the user's cache folder."""
Loaded = TypeVar("Loaded")
COMPILERS = ("cc", "gcc", "clang")
"""Looked for in this order, unless the environment variable CC names one."""


class CompileWarning(UserWarning):
    """A function could not be compiled; it is interpreted, which gives the same numbers later."""


class CompileError(Exception):
    """No compiler, or it does not work: the message says what was tried."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: the command, and what tells it from others (first line of its version, machine)."""

    command: tuple[str, ...]
    identity: str


def compiled(function: ca.Function) -> ca.Function:
    """Return a function as machine code, or itself with a `CompileWarning` where that can not be had."""
    try:
        return compile_function(function)
    except CompileError as failure:
        warnings.warn(f"{function.name()} is not compiled: {failure}", CompileWarning, stacklevel=2)
        return function


def compiler_problem() -> str | None:
    """Why nothing can be compiled here, in words; None when a small function was compiled and works."""
    x = ca.SX.sym("x")
    try:
        probe = compile_function(ca.Function("probe", [x], [x + 1]))
    except CompileError as failure:
        return str(failure)
    return None if float(probe(1.0)) == 2.0 else f"{find_compiler().command[0]} makes wrong code"


def compile_function(function: ca.Function) -> ca.Function:
    """Compile a function, or load it where it was compiled before.

    Raises
    ------
    CompileError
        No compiler, it fails, or its result can not be kept or loaded.
    """
    name = function.name()
    return load_library(name, _source(function), FLAGS, lambda library: ca.external(name, str(library)))


def library_of(function: ca.Function) -> ctypes.CDLL:
    """The library of a function that is compiled, or was: the one that `compile_function` loads.

    Raises
    ------
    CompileError
        No compiler, it fails, or its result can not be kept or loaded.
    """
    return load_library(function.name(), _source(function), FLAGS, lambda library: ctypes.CDLL(str(library)))


@dataclass(frozen=True)
class Written:
    """C source that is written only where it must be compiled.

    Attributes
    ----------
    key
        Tells the source from every other one: what it is written from, and the program that writes it.
    write
        Writes it.
    """

    key: str
    write: Callable[[], str]


def load_library(name: str, source: str | Written, flags: Sequence[str], load: Callable[[Path], Loaded]) -> Loaded:
    """Compile C source into a shared library, where this was not done before, and load it.

    Parameters
    ----------
    name
        What it is, the beginning of the name of its file.
    source, flags
        The source, and the options of the compiler.
    load
        Loads the file; raises RuntimeError or OSError where it can not.

    Raises
    ------
    CompileError
        No compiler, it fails, or the library can not be kept, trusted or loaded.
    """
    compiler = find_compiler()
    library = _place(name, source, flags, compiler)
    if os.path.lexists(library):
        _check_safe(library)
        # an unfinished library is never there, but a disk may have lost part of one
        with suppress(RuntimeError, OSError):
            loaded = load(library)
            used(library)
            return loaded
    _build(source, compiler, flags, library)
    _check_safe(library)
    try:
        return load(library)
    except (RuntimeError, OSError) as error:
        raise CompileError(f"{library} can not be loaded ({_last_line(str(error))})") from error


def is_kept(name: str, source: str | Written, flags: Sequence[str]) -> bool:
    """Whether C source was compiled before, by the compiler that would be asked now."""
    try:
        return os.path.lexists(_place(name, source, flags, find_compiler()))
    except CompileError:
        return False


def _place(name: str, source: str | Written, flags: Sequence[str], compiler: Compiler) -> Path:
    content = "\0".join([source.key if isinstance(source, Written) else source, compiler.identity, *flags])
    return cache_folder() / f"{name}-{hashlib.sha256(content.encode()).hexdigest()[:24]}.so"


def _check_safe(path: Path, levels: int = CACHE_LEVELS) -> None:
    problem = problem_of(path, levels)
    if problem is not None:
        raise CompileError(problem)


def cache_folder() -> Path:
    """Folder of compiled functions, those used last; deleting it costs nothing but the time to compile again."""
    return user_cache_path("adaptive-flot", appauthor=False) / "compiled"


def find_compiler() -> Compiler:
    """The C compiler of this system: what CC says, else the first of `COMPILERS` on the path.

    Raises
    ------
    CompileError
        None there, or it does not say its version.
    """
    return _compiler(os.environ.get("CC", ""), os.environ.get("PATH", ""))


@lru_cache(maxsize=8)
def _compiler(named: str, path: str) -> Compiler:
    wanted = shlex.split(named)
    names = wanted[:1] or list(COMPILERS)
    program = next((found for name in names if (found := shutil.which(name, path=path))), None)
    if program is None:
        tried = f"{names[0]}, which the variable CC names," if wanted else f"{', '.join(COMPILERS)}"
        raise CompileError(f"no C compiler found (looked for {tried} on the path); install one, for example gcc")
    command = (program, *wanted[1:])
    said = _run([*command, "--version"], "its version")
    return Compiler(command, "\n".join([*command, said.partition("\n")[0], platform.machine(), platform.system()]))


def _source(function: ca.Function) -> str:
    generator = ca.CodeGenerator("adaptive_flot.c")
    try:
        generator.add(function)
        return str(generator.dump())
    except RuntimeError as error:
        raise CompileError(f"CasADi writes no C for it ({_last_line(str(error))})") from error


def _build(source: str | Written, compiler: Compiler, flags: Sequence[str], library: Path) -> None:
    """Compile a source and put the result in its place, whole."""
    try:
        make_private(library.parent)
        _check_safe(library.parent, CACHE_LEVELS - 1)
        with tempfile.TemporaryDirectory(prefix=".compiling-", dir=library.parent) as folder:
            code, made = Path(folder) / "function.c", Path(folder) / "function.so"
            code.write_text(source.write() if isinstance(source, Written) else source, encoding="utf-8")
            _run([*compiler.command, *flags, str(code), "-o", str(made), "-lm"], library.name)
            made.chmod(0o700)
            made.replace(library)
        tidy(library.parent)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CompileError(f"compiled functions can not be kept in {library.parent} ({reason})") from error


def _run(command: list[str], what: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise CompileError(f"{command[0]} can not be run ({error.strerror or error})") from error
    if done.returncode != 0:
        said = _last_line(done.stderr) or f"exit code {done.returncode}"
        raise CompileError(f"{command[0]} failed on {what} ({said})")
    return done.stdout


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""
