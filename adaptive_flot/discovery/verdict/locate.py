"""Locate: where in the process the missing effect acts - at a sensor, an actuator, the feed, a flow or inside.

A sensor effect shows in its own output alone, an actuator or feed effect passes through the dynamics into several, a
missing relation recurs at the same operating point, an event stays. The first-order scores hold all of this: the best
one of each kind of place, and of each kind of cause, says how well it would do.
"""

from __future__ import annotations

from adaptive_flot.discovery.candidates.dynamics import BOUNDS
from adaptive_flot.discovery.candidates.score_test import Score
from adaptive_flot.discovery.results import Detection, Location, Place
from adaptive_flot.greybox.effects import DYNAMIC_DRIVERS

CAUSES = {
    "constant": "all the time",
    "time": "with time",
    **dict.fromkeys((*DYNAMIC_DRIVERS, *BOUNDS), "late or limited"),
}


def locate(detection: Detection, scores: tuple[Score, ...]) -> Location:
    """Rank the kinds of places and causes by the best first-order gain of each; shares are of the best of all."""
    best = max((s.gain for s in scores), default=0.0)
    places: dict[str, Place] = {}
    causes: dict[str, Place] = {}
    for s in sorted(scores, key=lambda s: -s.gain):
        c = s.candidate
        share = s.gain / best if best > 0 else 0.0
        place = Place(c.site.role, c.site.name, c.driver, share)
        places.setdefault(place.kind, place)
        cause = CAUSES.get(c.driver, "with the operating point")
        causes.setdefault(cause, Place(cause, c.site.name, c.driver, share))
    return Location(detection.outputs, tuple(places.values()), tuple(causes.values()))
