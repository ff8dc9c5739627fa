"""Fresh rows of explanations are those that are given."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.discovery.innovations import judge as judging
from tests.discovery.innovations.told.judged.given import ROWS


@pytest.fixture(autouse=True)
def _given_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fresh rows are those given; better explanations are better by the same in every row, and told apart."""
    monkeypatch.setattr(judging, "_fresh_rows", lambda search, e: np.full(ROWS, e.fresh))
    monkeypatch.setattr(judging, "told_apart", lambda search, base, best, other: best is not other)
