"""Names and indices of the sites and drivers, and of a few sites that no list of known effects has."""

from __future__ import annotations

PROCESS_SITES = (
    "air_flow",
    "feed_flow",
    "feed_grade",
    "bubble_size",
    "gas_slip",
    "burst_rate",
    "coalescence",
    "growth_exponent",
    "froth_recovery",
    "entrainment",
    "settling",
    "concentrate_flow",
    "floatability_valuable",
    "floatability_gangue",
    "tails_valve",
)
SENSOR_SITES = ("grade_sensor", "level_sensor", "tails_sensor", "air_recovery_sensor", "concentrate_flow_sensor")
LISTED_SITES = PROCESS_SITES + SENSOR_SITES
UNLISTED_SITES = ("film_drainage",)  # k_1: the drag in the Plateau borders, which viscosity and density move
SITES = LISTED_SITES + UNLISTED_SITES
INDEX = {name: index for index, name in enumerate(SITES)}

STATE_DRIVERS = ("air_flow", "feed_flow", "level", "froth_depth", "grade", "solids", "valuable_solids")
DRIVERS = ("constant", "time", *STATE_DRIVERS, "lag", "delay")

OUTPUTS = ("level_m", "tails_flow_m3_s", "concentrate_grade", "air_recovery", "concentrate_flow_m3_s")
INPUTS = ("air_flow_m3_s", "feed_flow_m3_s", "level_setpoint_m")
SENSOR_OF = dict(
    zip(
        OUTPUTS,
        ("level_sensor", "tails_sensor", "grade_sensor", "air_recovery_sensor", "concentrate_flow_sensor"),
        strict=True,
    )
)
