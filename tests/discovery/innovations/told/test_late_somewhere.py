"""That something is late is certain where every explanation has a lag, and its place is open."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.innovations import in_words
from adaptive_flot.discovery.innovations.late import late_somewhere
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.greybox import Effect

GAIN = 500.0


@dataclass(frozen=True)
class Explained:
    """An explanation, its gain alone."""

    hypotheses: tuple[Hypothesis, ...]
    criterion: float


def _h(site: str, kind: Any = "lag", driver: str = "lag") -> Hypothesis:
    return Hypothesis(site, driver, kind, Effect(site, "constant", "shift"), ("amplitude",), ({},))


GAUGE, PUMP, VALVE, LEAK = _h("gauge"), _h("pump"), _h("valve"), _h("leak", "depends", "level")
DEAD_TIME = _h("pump", driver="delay")
BASE: Any = Explained((), 0.0)
ALONE: Any = Explained((GAUGE,), GAIN)


def _somewhere(*alike: Any, elsewhere: tuple[Explained, ...] = ()) -> Told | None:
    search: Any = SimpleNamespace(late_elsewhere=lambda explanation, late: list(elsewhere))
    return late_somewhere(search, BASE, alike)


@pytest.mark.parametrize(
    "best",
    [
        (PUMP, VALVE),  # lags of all inputs do what a lag of the output does
        (PUMP, LEAK),  # what is beside it is open: without it the gauge explains as much
    ],
)
def test_the_places_of_the_lags_are_a_class(best: tuple[Hypothesis, ...]) -> None:
    told = _somewhere(Explained(best, GAIN + 30.0), ALONE)
    assert told is not None and told.word == "class" and not told.certain
    assert [h.site for _, h in told.open] == ["gauge", *(h.site for h in best if h.kind == "lag")]
    assert told.best == ALONE, "one effect is told, and not two"


def test_a_place_with_most_of_the_gain_is_one_of_them() -> None:
    """SAME_LAG of the gain, alone, is enough for a place that no explanation near the best has."""
    told = _somewhere(Explained((PUMP, LEAK), GAIN + 30.0), ALONE, elsewhere=(Explained((VALVE,), 0.9 * GAIN),))
    assert told is not None and {h.site for _, h in told.open} == {"gauge", "pump", "valve"}


@pytest.mark.parametrize(
    "alike",
    [
        (Explained((PUMP, VALVE), GAIN), Explained((GAUGE, LEAK), GAIN)),  # no lag explains it alone
        (Explained((LEAK,), GAIN), ALONE),  # one explanation has no lag
        (Explained((DEAD_TIME, LEAK), GAIN), ALONE),  # a dead time is none
        (Explained((PUMP, VALVE, _h("feed"), _h("drain")), GAIN), ALONE),  # too many places
    ],
)
def test_else_it_is_not_told(alike: tuple[Explained, ...]) -> None:
    assert _somewhere(*alike) is None


def test_lags_that_act_together_are_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_words, "words_at", lambda search, explanation, h: f"{h.site} is late")
    told = _somewhere(Explained((PUMP, VALVE), GAIN + 30.0), ALONE)
    search: Any = None
    assert told is not None
    assert "apart: gauge is late; or pump is late, and valve is late." in in_words.told_in_words(search, told)
