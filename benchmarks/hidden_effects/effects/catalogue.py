"""The menu of truths: what may act where, what it depends on, its sign, its shapes and how far it may go.

Effects known in flotation (sites and drivers as a metallurgist would list them) plus a disturbance for every site;
amplitude signs follow the physics where they have one (0 = either).
"""

from __future__ import annotations

from typing import NamedTuple

STATIC = ("hill", "logistic", "hard_limit", "kink", "hump", "arctan", "bistable")
RISING = ("hill", "logistic", "hard_limit", "kink", "arctan", "bistable")
SUDDEN = ("smooth_step", "washout", "plateau")
SLOW = ("gompertz", "fouling", "swing", "wander")
ANY_TIME = ("smooth_step", "washout", "plateau", "dose", "gompertz", "fouling", "swing", "wander")
ADDITIVE = ("smooth_step", "gompertz", "fouling", "wander", "washout")

# Largest |amplitude| of the factor: down, up. Burst rate and air: beyond it the froth collapses.
LIMITS = {
    "air_flow": (0.2, 0.2),
    "feed_flow": (0.35, 0.35),
    "feed_grade": (0.6, 0.8),
    "bubble_size": (0.5, 0.8),
    "gas_slip": (0.5, 1.0),
    "burst_rate": (0.35, 0.09),
    "coalescence": (0.7, 2.0),
    "growth_exponent": (0.15, 0.2),
    "froth_recovery": (0.6, 0.8),
    "entrainment": (0.8, 3.0),
    "settling": (0.6, 1.5),
    "concentrate_flow": (0.6, 1.5),
    "floatability_valuable": (0.7, 1.0),
    "floatability_gangue": (0.8, 3.0),
    "tails_valve": (0.4, 0.5),
}


class Entry(NamedTuple):
    """One kind of hidden effect."""

    site: str
    driver: str
    sign: int
    shapes: tuple[str, ...]
    story: str


CATALOGUE = (
    # disturbances in time
    Entry("feed_grade", "time", 0, ANY_TIME, "ore change"),
    Entry("feed_flow", "time", 0, SUDDEN, "dilution water that no meter sees"),
    Entry("air_flow", "time", -1, SUDDEN, "air leak opens"),
    Entry("bubble_size", "time", 0, ANY_TIME, "frother dosage changes"),
    Entry("gas_slip", "time", 0, ANY_TIME, "surfactant slows the bubbles"),
    Entry("burst_rate", "time", 0, ANY_TIME, "froth stability changes"),
    Entry("coalescence", "time", 1, (*SUDDEN, "dose"), "frother depletion or dose"),
    Entry("growth_exponent", "time", 0, SUDDEN, "another froth regime"),
    Entry("froth_recovery", "time", 0, ANY_TIME, "froth crowder or lip changes"),
    Entry("entrainment", "time", 0, ANY_TIME, "wash water, fines"),
    Entry("settling", "time", 0, ANY_TIME, "particle size changes"),
    Entry("concentrate_flow", "time", 0, ANY_TIME, "launder or lip fouls"),
    Entry("floatability_valuable", "time", -1, ANY_TIME, "collector ageing, slimes coating"),
    Entry("floatability_gangue", "time", 1, ANY_TIME, "gangue activated"),
    Entry("tails_valve", "time", 0, SUDDEN, "valve wear or blockage"),
    # air
    Entry("bubble_size", "air_flow", 1, RISING, "bubbles grow with air"),
    Entry("burst_rate", "air_flow", 1, ("hump", "kink", "hard_limit", "bistable"), "air-recovery peak, froth collapse"),
    Entry("floatability_valuable", "air_flow", -1, RISING, "detachment in turbulence"),
    Entry("gas_slip", "air_flow", 1, RISING, "swarm regime"),
    Entry("coalescence", "air_flow", 0, STATIC, "coalescence with froth shear"),
    Entry("froth_recovery", "air_flow", 0, STATIC, "froth transport with air"),
    Entry("entrainment", "air_flow", 1, RISING, "wet froth at high air"),
    Entry("concentrate_flow", "air_flow", 0, STATIC, "lip overflow with air"),
    # feed flow, level, froth depth
    Entry("entrainment", "feed_flow", 1, RISING, "fines and turbulence with feed"),
    Entry("floatability_valuable", "feed_flow", -1, RISING, "contact time"),
    Entry("feed_grade", "feed_flow", -1, RISING, "surges are poorer ore"),
    Entry("froth_recovery", "froth_depth", -1, RISING, "deep-froth drop-back"),
    Entry("entrainment", "froth_depth", -1, RISING, "drainage in deep froth"),
    Entry("coalescence", "froth_depth", 1, RISING, "dry froth coalesces"),
    Entry("burst_rate", "froth_depth", 1, RISING, "deep froth bursts"),
    Entry("concentrate_flow", "level", 1, RISING, "pulp near the lip spills"),
    Entry("bubble_size", "level", 0, STATIC, "pressure at the sparger"),
    # solids, grade
    Entry("coalescence", "valuable_solids", -1, RISING, "loaded froth is stable"),
    Entry("coalescence", "solids", -1, RISING, "solids stabilise the froth"),
    Entry("burst_rate", "valuable_solids", -1, RISING, "loaded bubbles burst less"),
    Entry("froth_recovery", "grade", 0, STATIC, "clean froth drops back"),
    Entry("floatability_gangue", "valuable_solids", 1, RISING, "composites float"),
    Entry("floatability_valuable", "grade", -1, RISING, "liberated part floats first"),
    # constants
    Entry("air_flow", "constant", 0, ("level",), "air meter reads wrong"),
    Entry("feed_flow", "constant", 0, ("level",), "feed meter reads wrong"),
    Entry("feed_grade", "constant", 0, ("level",), "assay of the feed is wrong"),
    Entry("bubble_size", "constant", 0, ("level",), "sparger worn"),
    Entry("gas_slip", "constant", 0, ("level",), "surfactant"),
    Entry("burst_rate", "constant", 0, ("level",), "other frother"),
    Entry("froth_recovery", "constant", 0, ("level",), "other lip"),
    Entry("entrainment", "constant", 0, ("level",), "finer gangue"),
    Entry("settling", "constant", 0, ("level",), "other particle size"),
    Entry("concentrate_flow", "constant", 0, ("level",), "other lip"),
    Entry("floatability_valuable", "constant", 0, ("level",), "other collector"),
    Entry("floatability_gangue", "constant", 1, ("level",), "other depressant"),
    # actuators
    Entry("air_flow", "lag", 1, ("cascade",), "slow air valve"),
    Entry("air_flow", "delay", 1, ("cascade",), "long air line"),
    Entry("feed_flow", "lag", 1, ("cascade",), "feed box"),
    Entry("tails_valve", "lag", 1, ("cascade",), "slow tails valve"),
    Entry("tails_valve", "lag", 1, ("stiction",), "sticking tails valve"),
    # sensors
    Entry("grade_sensor", "constant", 0, ("offset",), "analyser offset"),
    Entry("grade_sensor", "constant", 0, ("gain", "bent"), "analyser calibration"),
    Entry("grade_sensor", "time", 0, ADDITIVE, "analyser drifts"),
    Entry("grade_sensor", "lag", 1, ("cascade",), "sample line"),
    Entry("grade_sensor", "delay", 1, ("dead_time", "multiplexed"), "dead time, multiplexed analyser"),
    Entry("level_sensor", "constant", 0, ("offset", "gain"), "level cell offset or gain"),
    Entry("level_sensor", "time", 0, ADDITIVE, "level cell drifts"),
    Entry("level_sensor", "air_flow", -1, ("hill", "logistic", "kink", "arctan"), "gas holdup fools the level cell"),
    Entry("level_sensor", "lag", 1, ("cascade",), "damped level cell"),
    Entry("tails_sensor", "constant", 0, ("offset", "gain"), "tails meter reads wrong"),
    Entry("tails_sensor", "time", 0, ADDITIVE, "tails meter drifts"),
    Entry("tails_sensor", "lag", 1, ("cascade",), "damped tails meter"),
    Entry("air_recovery_sensor", "constant", 0, ("offset", "gain"), "camera calibration"),
    Entry("air_recovery_sensor", "time", 0, ADDITIVE, "camera drifts"),
    Entry("air_recovery_sensor", "froth_depth", 0, RISING[:-1], "camera sees a lower froth"),
    Entry("air_recovery_sensor", "lag", 1, ("cascade",), "camera averages"),
    Entry("concentrate_flow_sensor", "constant", 0, ("gain",), "concentrate meter reads wrong"),
    Entry("concentrate_flow_sensor", "time", 0, ADDITIVE, "concentrate meter drifts"),
    Entry("concentrate_flow_sensor", "delay", 1, ("dead_time", "multiplexed"), "sampled concentrate"),
)


def equivalents(site: str, driver: str, shape: str) -> list[dict[str, str]]:
    """Other names of the same thing: `site`, `driver` and `why`, not counting the name itself."""
    same = []
    if driver in ("level", "froth_depth"):
        other = "froth_depth" if driver == "level" else "level"
        same.append({"site": site, "driver": other, "why": "froth depth is cell height minus level"})
    if driver == "delay" and shape != "dead_time":
        why = "a cascade, or sample and hold, lies between a lag and a dead time"
        same.append({"site": site, "driver": "lag", "why": why})
    if site in ("coalescence", "growth_exponent"):
        why = "n and C act only through the froth bubble size: exactly alike over time, nearly so over other drivers"
        other = "growth_exponent" if site == "coalescence" else "coalescence"
        same += [{"site": other, "driver": d, "why": why} for d in {driver, *(f["driver"] for f in same)}]
    if shape in ("gain", "bent") and site == "grade_sensor":
        same.append({"site": site, "driver": "grade", "why": "a calibration error is a function of the grade"})
    if shape == "gain" and site == "level_sensor":
        why = "a calibration error is a function of the level"
        same += [{"site": site, "driver": d, "why": why} for d in ("level", "froth_depth")]
    if shape == "stiction":
        why = "a sticking valve is late by no fixed time: any statement on the valve is right"
        same += [{"site": site, "driver": d, "why": why} for d in ("constant", "time", "level")]
    return sorted(same, key=lambda f: (f["site"], f["driver"]))
