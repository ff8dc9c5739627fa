"""The user's cache is neither used nor filled by these tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from adaptive_flot.greybox.stepping.compiling import compiled


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)
    yield
    compiled._compiler.cache_clear()
