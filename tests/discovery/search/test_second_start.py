"""Candidates whose constants ended far from those of the best one are fitted from there as well, and no others."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.search.halving.jobs import FittedJob
from adaptive_flot.discovery.search.halving.refits import Refit
from adaptive_flot.discovery.search.halving.restarts import from_constants_of_the_best


def fitted(driver: str, bic: float, ua: float, holdup: float) -> FittedJob:
    fit = SimpleNamespace(names=("ua", "holdup", "effect"), values=np.array([ua, holdup, 1.0]), bic=bic)
    alternative: Any = SimpleNamespace(names=(("transfer", driver),), fit=fit)
    score: Any = driver
    return FittedJob(0, score, alternative)


def test_who_stayed_with_absurd_constants_starts_again_from_those_of_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    halving = Refit.__new__(Refit)
    halving.fitter = SimpleNamespace(problem=SimpleNamespace(adapted=("ua", "holdup")))  # type: ignore[assignment]
    ran: list[Any] = []

    def run(jobs: list[Any]) -> list[FittedJob]:
        ran.extend(jobs)
        return []

    monkeypatch.setattr(halving, "run", run)
    best, near = fitted("best", -2000.0, 8.0, 140.0), fitted("near", -1900.0, 3.0, 60.0)
    far, early = fitted("far", -500.0, 2.5, 640.0), fitted("early", -400.0, 2.5, 640.0)
    from_constants_of_the_best(halving, [far, best, near], [early])
    assert [(job.score, job.warm) for job in ran] == [("far", best.alternative.fit), ("early", best.alternative.fit)]
    assert from_constants_of_the_best(halving, [], [early]) == []
