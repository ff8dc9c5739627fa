"""Run a discover command on every record, in its own process group with a time limit; go on where it stopped.

DIR/runs/LABEL/run.json                         the command, so that no two are mixed under one label
DIR/runs/LABEL/verdicts/record_0000.json        what the command wrote
DIR/runs/LABEL/verdicts/record_0000.meta.json   how it ended: ok, refused (exit 2), crash, timeout; seconds
DIR/runs/LABEL/verdicts/record_0000.log         the end of what it printed, if it did not end well
"""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from adaptive_flot.errors import DataError
from adaptive_flot.files import write_text
from benchmarks.hidden_effects.generate.folder import answer_file, load_answers, record_file

LOG_CHARACTERS = 4000


def run_command(
    folder: Path, label: str, command: str, jobs: int, timeout: float, advance: Callable[[], None] = lambda: None,
    count: int | None = None,
) -> None:  # fmt: skip
    """Run a command template on every record that has no verdict under this label yet.

    {record}, {json} and {answer} in the template are replaced by paths; the last is for the oracle alone.

    Raises
    ------
    DataError
        Another command ran under this label, or the template names no record or verdict.
    """
    if "{record}" not in command or "{json}" not in command:
        raise DataError(f"--command {command!r}: must hold {{record}} and {{json}}")
    run = folder / "runs" / label
    _claim(run, command)
    with ThreadPoolExecutor(jobs) as pool:
        todo = _left(folder, run, advance, count)
        for future in as_completed([pool.submit(_one, folder, run, name, command, timeout) for name in todo]):
            future.result()
            advance()


def run_method(
    folder: Path, method: str, label: str, command: str, jobs: int, advance: Callable[[], None] = lambda: None,
    count: int | None = None,
) -> None:  # fmt: skip
    """The same for a rival, of which `command` says how to run it alone: in processes that load the libraries once.

    Raises
    ------
    DataError
        Another command ran under this label.
    """
    run = folder / "runs" / label
    _claim(run, command)
    with ProcessPoolExecutor(jobs) as pool:
        todo = _left(folder, run, advance, count)
        for future in as_completed([pool.submit(_judged, folder, run, name, method) for name in todo]):
            future.result()
            advance()


def _left(folder: Path, run: Path, advance: Callable[[], None], count: int | None) -> list[str]:
    """Names of the records that have no verdict yet; `advance` is called for the others."""
    names = list(load_answers(folder, count))
    todo = [name for name in names if not (run / "verdicts" / f"{name}.meta.json").is_file()]
    for _ in range(len(names) - len(todo)):
        advance()
    return todo


def _judged(folder: Path, run: Path, name: str, method: str) -> None:
    """Judge one record with a rival and write how it ended."""
    from benchmarks.hidden_effects.rivals import judge

    begun, status, printed = time.perf_counter(), "ok", ""
    out = run / "verdicts" / f"{name}.json"
    out.unlink(missing_ok=True)
    try:
        judge(method, record_file(folder, name), out, answer_file(folder, name) if method == "oracle" else None)
    except Exception:  # whatever a rival stumbles over on one record is an outcome of that record
        status, printed = "crash", traceback.format_exc()
    _ended(run, name, {"status": status, "exit": int(status != "ok"), "seconds": _since(begun)}, printed)


def _since(begun: float) -> float:
    return round(time.perf_counter() - begun, 3)


def _ended(run: Path, name: str, meta: dict[str, Any], printed: str) -> None:
    """Write how a record ended, and the end of what was printed if it did not end well."""
    if meta["status"] != "ok":
        write_text(run / "verdicts" / f"{name}.log", printed[-LOG_CHARACTERS:] + "\n")
    write_text(run / "verdicts" / f"{name}.meta.json", json.dumps(meta) + "\n")


def _claim(run: Path, command: str) -> None:
    file = run / "run.json"
    if file.is_file():
        known = json.loads(file.read_text())["command"]
        if known != command:
            raise DataError(f"{file}: this label ran {known!r}, not {command!r}; give another --label")
        return
    write_text(file, json.dumps({"command": command, "started": time.strftime("%Y-%m-%d %H:%M:%S")}) + "\n")


def _one(folder: Path, run: Path, name: str, command: str, timeout: float) -> None:
    """Run the command on one record and write how it ended."""
    out = run / "verdicts" / f"{name}.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.unlink(missing_ok=True)
    paths = {"{record}": record_file(folder, name), "{json}": out, "{answer}": answer_file(folder, name)}
    words = shlex.split(command)
    for key, path in paths.items():
        words = [word.replace(key, str(path)) for word in words]
    _ended(run, name, *_execute(words, timeout))


def _execute(words: list[str], timeout: float) -> tuple[dict[str, Any], str]:
    """Status and seconds of a command, and what it printed. Its whole process group ends with it."""
    begun = time.perf_counter()
    try:
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace", start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        raise DataError(f"--command: {words[0]} can not be run ({error.strerror or error})") from error
    try:
        printed, _ = process.communicate(timeout=timeout)
        status = {0: "ok", 2: "refused"}.get(process.returncode, "crash")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        printed, _ = process.communicate()
        status = "timeout"
    return {"status": status, "exit": process.returncode, "seconds": _since(begun)}, printed
