"""Write results: JSON without NaN, tables and pages, each whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from adaptive_flot import provenance
from adaptive_flot.files import write_text
from adaptive_flot.greybox.data.tables import write_table
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.scenario import Scenario


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON; numbers that are not finite become null."""
    write_text(path, json.dumps(plain(content), indent=1, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """Reduce a result to what JSON knows.

    >>> plain({"a": float("nan"), "b": np.array([1.0, 2.0])})
    {'a': None, 'b': [1.0, 2.0]}
    """
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def run_summary(scenario: Scenario, runs: Sequence[Run]) -> dict[str, Any]:
    """JSON summary of a scenario; with economics also what `compare` must know to compare like with like."""
    head: dict[str, Any] = {"scenario": scenario.name, "code": provenance.code()}
    if scenario.limits is not None and scenario.prices is not None:
        head |= {"conditions": conditions(scenario), "grade_limit": scenario.limits.outputs["concentrate_grade"][0]}
    return {**head, "runs": [{**run.summary(), "options": _options(scenario, run)} for run in runs]}


def _options(scenario: Scenario, run: Run) -> dict[str, dict[str, str]]:
    """Options of estimator and controller of a run that are not at their default, as text."""
    plugins = {
        "estimator": scenario.file.estimators.get(run.estimator),
        "controller": scenario.file.controllers.get(run.controller),
    }
    return {
        who: {key: str(value) for key, value in plugin.options.items()}
        for who, plugin in plugins.items()
        if plugin is not None and plugin.options
    }


def time_series_file(folder: Path, estimator: str, controller: str, seed: int) -> Path | None:
    """The time series that `write_runs` wrote of a run; None where there is none."""
    stem = _stem_of(estimator, controller, seed)
    return next((p for suffix in (".csv", ".parquet") if (p := folder / f"{stem}{suffix}").is_file()), None)


def write_runs(runs: Sequence[Run], folder: Path, suffix: str = ".csv") -> list[Path]:
    """Write the time series of each run as `<estimator>_<controller>_seed<N>`, its plans as `..._plans` beside it.

    Returns
    -------
    list of Path
        The time series.
    """
    for run in runs:
        write_table(run.table, folder / f"{_stem(run)}{suffix}")
        if not run.plans.empty:
            write_table(run.plans, folder / f"{_stem(run)}_plans{suffix}")
    return [folder / f"{_stem(run)}{suffix}" for run in runs]


def run_files(runs: Sequence[Run], folder: Path, suffix: str = ".csv") -> list[Path]:
    """All files that `write_runs` will write."""
    plans = [folder / f"{_stem(run)}_plans{suffix}" for run in runs if not run.plans.empty]
    return [*(folder / f"{_stem(run)}{suffix}" for run in runs), *plans]


def _stem(run: Run) -> str:
    return _stem_of(run.estimator, run.controller, run.seed)


def _stem_of(estimator: str, controller: str, seed: int) -> str:
    return f"{estimator}_{controller}_seed{seed}".replace(":", "-").replace("/", "-")
