"""Protects: many sets of several effects, none of which comes near the noise, are no class that anyone can use."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from adaptive_flot.discovery.results import OutputChange
from adaptive_flot.discovery.verdict.heed_report import _many_and_none


def _judged(count: int, effects: int, part: tuple[tuple[str, str], ...] = ()) -> SimpleNamespace:
    sets = [SimpleNamespace(names=tuple((f"site_{i}_{k}", "time") for k in range(effects))) for i in range(count)]
    return SimpleNamespace(best=sets[0], rivals=sets[1:], near=lambda a: True, part=part)


@pytest.mark.parametrize(
    ("count", "effects", "left", "many"),
    [(6, 3, 2.5, True), (6, 3, 1.5, False), (3, 3, 2.5, False), (6, 1, 2.5, False), (4, 2, 2.5, True)],
)
def test_a_hysteresis_is_not_told_as_six_sets_of_three(count: int, effects: int, left: float, many: bool) -> None:
    error = (OutputChange("displacement", "mm", 5.0, left, 1.0, (20.0, 60.0)),)
    assert _many_and_none(_judged(count, effects), error) == many  # type: ignore[arg-type]
    part = _judged(count, effects, (("spring", "displacement"),))
    assert not _many_and_none(part, error)  # type: ignore[arg-type]
