"""Protects: what acts at a balance without a site is an amount. By a factor it is another store, and that has a place.

A softer oil was told as "what stores pressure were 4 times as large; or as if something takes 1.38 bar/s from the
balance of pressure": both were the same factor, and the amount was the logarithm of it.
"""

from __future__ import annotations

from types import SimpleNamespace

from adaptive_flot.discovery.further_sites.places import further_sites, with_further_sites
from adaptive_flot.discovery.innovations.screening import Screening
from tests.discovery.innovations.box import model


def test_each_further_place_has_one_way_to_change() -> None:
    extended = with_further_sites(model())
    screening = SimpleNamespace(model=extended)
    for site in further_sites(extended):
        assert Screening._modes_of_switch(screening, site) == (site.mode,), site.name  # type: ignore[arg-type]


def test_a_site_of_the_model_that_enters_a_balance_has_more() -> None:
    """A force may be half as strong, though forces add up."""
    extended = with_further_sites(model())
    other = next(s for s in extended.sites if s.name == "other_heat")
    modes = Screening._modes_of_switch(SimpleNamespace(model=extended), other)  # type: ignore[arg-type]
    assert modes == ("offset", "factor")
