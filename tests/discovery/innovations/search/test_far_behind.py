"""What is far behind after a few steps is not fitted to the end; what is near the best is, and the best stays it."""

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.search import search as rooms
from adaptive_flot.discovery.innovations.search.beam import screened_beside
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from benchmarks.other_processes.plants.heat_exchanger import make_model as model
from tests.discovery.innovations.exchanger import HOLDUP, UA, record


def fitted(far: float, monkeypatch: pytest.MonkeyPatch) -> tuple[list[Explanation], int]:
    """Explanations of a record whose heat transfer falls, and how many of them were fitted to the end."""
    data = record("nothing")
    warmer = np.arange(len(data)) > len(data) // 2
    data = replace(data, outputs=data.outputs + 3.0 * warmer[:, None])
    search = Search(model(), data, (0,), noise_floor([data], (0,)), ("ua", "holdup"))
    monkeypatch.setattr(rooms, "FAR", far)
    monkeypatch.setattr(rooms, "FAR_SHARE", 0.0)
    ended: list[Explanation] = []
    to_the_end = Search._to_the_end

    def counted(self: Search, begun: Explanation) -> Explanation:
        ended.append(begun)
        return to_the_end(self, begun)

    monkeypatch.setattr(Search, "_to_the_end", counted)
    with np.errstate(all="ignore"):
        base = search.base(np.array([UA, HOLDUP]))
        _, screened = screened_beside(search, base)
        found = search.all_with(base, [s for s in screened if s.gain > 0][:8])
    return sorted(found, key=lambda e: -e.criterion), len(ended)


def test_the_best_is_the_same_and_fewer_are_fitted_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    everything, all_of_them = fitted(np.inf, monkeypatch)
    near, some = fitted(20.0, monkeypatch)
    assert 0 < some < all_of_them
    assert near[0].names == everything[0].names
    assert near[0].criterion == pytest.approx(everything[0].criterion, abs=1e-6)
    for e in near:  # what was left as it was is no better than what a whole fit makes of it
        whole = next(w for w in everything if w.names == e.names)
        assert e.criterion <= whole.criterion + 1e-6
