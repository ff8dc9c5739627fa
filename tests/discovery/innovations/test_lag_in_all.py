"""One lag is told where it is in every explanation that is as good, at whatever place: lags in a row commute."""

from types import SimpleNamespace
from typing import Any

import pytest

from adaptive_flot.discovery.innovations.judge import _is_in_all
from adaptive_flot.discovery.innovations.screening import Screened
from adaptive_flot.discovery.innovations.search import LAGS_ELSEWHERE, _spread


def effect(site: str, kind: str) -> Any:
    driver = {"lag": "lag", "switch": "time"}.get(kind, "own_value")
    return SimpleNamespace(site=site, driver=driver, kind=kind, label=f"{site} {kind}")


def explanation(*effects: Any) -> Any:
    return SimpleNamespace(hypotheses=effects)


LATE = explanation(effect("thermometer", "lag"))
LATE_AND_MORE = explanation(effect("heater", "lag"), effect("loss", "switch"))
OTHER = explanation(effect("heater", "range"), effect("loss", "switch"))


@pytest.mark.parametrize(
    ("alike", "told"),
    [((LATE_AND_MORE, LATE), True), ((LATE_AND_MORE, LATE, OTHER), False), ((LATE,), False)],
)
def test_what_is_in_every_explanation_is_told_without_the_rest(alike: tuple[Any, ...], told: bool) -> None:
    assert _is_in_all(LATE, alike) == told


def test_lags_are_refitted_whatever_a_regression_says_of_them() -> None:
    """Process noise follows what a lag does: a late thermometer of 830 in log-likelihood had none by regression."""

    def screened(site: str, kind: str, gain: float) -> Any:
        return Screened(SimpleNamespace(hypothesis=effect(site, kind)), (), gain)  # type: ignore[arg-type]

    ranked = [screened("loss", "gain", 50.0), screened("heater", "lag", -1.0), screened("thermometer", "lag", -9.0)]
    chosen = [s.suspect.hypothesis.label for s in _spread(ranked)]
    assert chosen == ["loss gain", "heater lag", "thermometer lag"]
    many = [screened(f"sensor {k}", "lag", -float(k)) for k in range(9)]
    assert len(_spread(many)) == LAGS_ELSEWHERE
