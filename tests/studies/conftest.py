"""Small studies of a short scenario, and a cluster in this process to run them on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from distributed import Client, LocalCluster

from adaptive_flot.studies import sweep
from tests.edits import edit
from tests.runner.conftest import edited

STUDY = """
description: A short scenario, a few seeds
scenarios: [short.yaml]
estimators: [rpem, fixed]
seeds: {first: 1, count: 3}
"""
SHORT = {"duration_s": 60, "initial_estimate.until_s": 30, "fits_after_s": 30}

WriteStudy = Callable[..., Path]


@pytest.fixture
def write_study(tmp_path: Path) -> WriteStudy:
    """Write `study.yaml` and its scenario `short.yaml` of a minute, with changes of both by dotted path."""

    def write(changes: Mapping[str, Any] | None = None, scenario: Mapping[str, Any] | None = None) -> Path:
        content = edited({**SHORT, **(scenario or {})})
        (tmp_path / "short.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
        file = tmp_path / "study.yaml"
        file.write_text(yaml.safe_dump(edit(yaml.safe_load(STUDY), changes or {}), sort_keys=False))
        return file

    return write


@pytest.fixture(scope="session")
def cluster() -> Iterator[Client]:
    """One worker with two threads, in this process."""
    options: dict[str, Any] = {
        "n_workers": 1,
        "threads_per_worker": 2,
        "processes": False,
        "dashboard_address": "127.0.0.1:0",
    }
    with LocalCluster(**options) as local, Client(local) as client:
        yield client


@pytest.fixture
def at_hand(cluster: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps run on that cluster: nothing has to start."""

    @contextmanager
    def connected(workers: int | None, scheduler: str | None) -> Iterator[Client]:
        del workers, scheduler
        yield cluster

    monkeypatch.setattr(sweep, "connected", connected)


@pytest.fixture(autouse=True)
def own_import_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders that a test's plug-ins put on the import path are gone after it."""
    monkeypatch.setattr(sys, "path", sys.path[:])
