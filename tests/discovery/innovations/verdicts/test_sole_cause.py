"""What is certain beside something that stays open is told alone, where it explains more than any other effect does."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.innovations.verdicts import sole_cause as tested
from adaptive_flot.greybox import Effect

SEARCH: Any = SimpleNamespace(late_elsewhere=lambda explanation, late: [])


@dataclass(frozen=True)
class Explained:
    """An explanation, its gain alone."""

    hypotheses: tuple[Hypothesis, ...]
    criterion: float


def _h(site: str, kind: Any) -> Hypothesis:
    return Hypothesis(site, "saturation", kind, Effect(site, "constant", "shift"), ("amplitude",), ({},))


HEATER, FAN, LOSS = _h("heater", "range"), _h("fan", "lag"), _h("loss", "depends")
BASE = Explained((), 0.0)
BOTH = Explained((HEATER, FAN), 600.0)


def _sole(monkeypatch: pytest.MonkeyPatch, found: list[Any], told: Any) -> Told | None:
    monkeypatch.setattr(tested, "told_apart", lambda search, base, a, b: a.criterion - b.criterion > 20)
    return tested.sole_cause(SEARCH, BASE, found, told)  # type: ignore[arg-type]


def _told(**changed: Any) -> Told:
    told = Told("class", BOTH, (HEATER,), ((BOTH, FAN),), (BOTH,), "")  # type: ignore[arg-type]
    return replace(told, **changed)


def test_what_is_certain_is_told_without_what_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = Explained((HEATER,), 500.0)
    sole = _sole(monkeypatch, [BOTH, alone, Explained((FAN,), 300.0)], _told())
    assert sole is not None and sole.word == "named" and sole.certain == (HEATER,)
    assert sole.best.criterion == alone.criterion and not sole.open


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ([BOTH, Explained((FAN,), 510.0), Explained((HEATER,), 500.0)], _told()),  # another explains more alone
        ([BOTH, Explained((HEATER,), 500.0), Explained((FAN,), 490.0)], _told()),  # not told from another
        ([BOTH], _told()),  # never tried alone
        ([BOTH, Explained((HEATER,), 500.0)], _told(certain=(HEATER, FAN), open=())),  # two are certain
        ([BOTH, Explained((HEATER,), 500.0)], _told(word="abstain")),
        ([BOTH, Explained((LOSS,), 500.0)], _told(certain=(LOSS,))),  # a plant has it or not: it has not changed
    ],
)
def test_else_nothing_is_told(monkeypatch: pytest.MonkeyPatch, found: list[Any], told: Told) -> None:
    assert _sole(monkeypatch, found, told) is None
