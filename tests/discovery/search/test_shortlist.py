"""The shortlist: two thirds by rank, the rest by site, none twice, no mirror of a driver."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.candidates.catalogue import Candidate
from adaptive_flot.discovery.candidates.score_test import Score, Scorer
from adaptive_flot.discovery.search.alternatives import SHORTLIST_EACH, shortlist
from adaptive_flot.greybox.scope import Site
from adaptive_flot.processes import flotation

SITES = flotation.make_model().sites
DRIVERS = ("air_flow", "feed_flow", "solids", "grade", "time")


def _scorer(gains: dict[tuple[Site, str], float], drivers: dict[str, Any] | None = None) -> Scorer:
    scores = [
        Score(Candidate(site, driver, True, ()), cast(Any, None), g, g, {}) for (site, driver), g in gains.items()
    ]
    ranked = sorted(scores, key=lambda s: -s.gain)
    return cast(Scorer, SimpleNamespace(scores=lambda: ranked, drivers=drivers or {}))


@given(st.integers(0, 1000), st.integers(3, 12))
def test_best_first_few_a_site_and_some_of_other_sites(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    gains = {(s, d): float(100 - 60 * rng.random()) for s in SITES for d in DRIVERS}
    found = shortlist(_scorer(gains), count)
    names = [s.candidate.name for s in found]
    assert len(names) == count == len(set(names))
    assert [s.gain for s in found] == sorted((s.gain for s in found), reverse=True)
    assert found[0].gain == max(gains.values())
    sites = [site for site, _ in names]
    assert max(map(sites.count, sites)) <= SHORTLIST_EACH
    assert len(set(sites)) > count // 3


def test_what_explains_little_or_no_more_than_a_constant_is_left_out() -> None:
    one, other = SITES[:2]
    gains = {(one, "constant"): 90.0, (one, "time"): 93.0, (one, "solids"): 99.0, (other, "time"): 20.0}
    assert [s.candidate.name for s in shortlist(_scorer(gains))] == [(one.name, "solids"), (one.name, "constant")]


@pytest.mark.parametrize("mirrored", [True, False])
def test_of_two_drivers_that_say_the_same_one_is_enough(mirrored: bool) -> None:
    level = np.linspace(0, 1, 50)
    other = 1 - level if mirrored else level**2
    gains = {(SITES[0], "level"): 50.0, (SITES[0], "froth_depth"): 49.0}
    found = shortlist(_scorer(gains, {"level": level, "froth_depth": other}))
    assert len(found) == (1 if mirrored else 2)


@pytest.mark.parametrize("off", [-1e-9, 0.0, 1e-9])
def test_of_mirrors_that_score_alike_rounding_does_not_choose(off: float) -> None:
    level = np.linspace(0, 1, 50)
    gains = {(SITES[0], "level"): 50.0, (SITES[0], "froth_depth"): 50.0 * (1 + off)}
    (found,) = shortlist(_scorer(gains, {"level": level, "froth_depth": 1 - level}))
    assert found.candidate.driver == "level"
    gains = {(SITES[0], "level"): 49.0, (SITES[0], "froth_depth"): 50.0}
    (found,) = shortlist(_scorer(gains, {"level": level, "froth_depth": 1 - level}))
    assert found.candidate.driver == "froth_depth"
