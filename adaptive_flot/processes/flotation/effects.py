"""Effects known in flotation that the cell model lacks: what a search may call by name.

A search looks at every site with every driver; what is not in this table may fit as well, but is reported as a curve
without a name. Sources: Wills & Finch, *Wills' Mineral Processing Technology*, 8th ed., chapter 12 (frother, collector,
slimes, sensors); Hadler & Cilliers, Minerals Engineering 22 (2009) 451 (air-recovery peak); Neethling & Brito-Parada,
Minerals Engineering 121 (2018) 22 (bursting); Finch & Dobby, *Column Flotation* (1990) (bubble size, gas holdup and
level measurement); Yianatos et al., Chem. Eng. Sci. 43 (1988) (froth drop-back).
"""

from __future__ import annotations

from adaptive_flot.greybox.quantities import KnownEffect

_FROTHER = "frother depletion, dosage or quality"
_SENSORS = {
    "grade_sensor": "on-stream analyser",
    "level_sensor": "level cell",
    "tails_sensor": "tails flow meter",
    "air_recovery_sensor": "froth camera",
    "concentrate_flow_sensor": "concentrate flow meter",
}

KNOWN_EFFECTS: tuple[KnownEffect, ...] = (
    *(KnownEffect(site, "constant", f"{what} with an offset or gain error") for site, what in _SENSORS.items()),
    *(KnownEffect(site, "time", f"{what} that drifts or jumps") for site, what in _SENSORS.items()),
    *(KnownEffect(site, "lag", f"{what} with a slow response") for site, what in _SENSORS.items()),
    *(
        KnownEffect(site, "delay", f"{what} with dead time (sample line, multiplexing)")
        for site, what in _SENSORS.items()
    ),
    KnownEffect("level_sensor", "air_flow", "gas holdup that fools the level cell"),
    KnownEffect("air_flow", "constant", "air meter error or a constant leak"),
    KnownEffect("air_flow", "time", "air leak or blocked sparger with an onset"),
    KnownEffect("air_flow", "lag", "slow air valve"),
    KnownEffect("air_flow", "delay", "dead time of the air line"),
    KnownEffect("air_flow", "saturation", "air valve or blower at its limit"),
    KnownEffect("feed_flow", "constant", "feed flow meter error"),
    KnownEffect("feed_flow", "time", "feed flow that drifts from its meter"),
    KnownEffect("feed_flow", "lag", "feed that follows its demand slowly: pump, sump, launder"),
    KnownEffect("feed_flow", "delay", "dead time of the feed line"),
    KnownEffect("feed_grade", "constant", "feed richer or poorer than assumed"),
    KnownEffect("feed_grade", "time", "feed grade disturbance"),
    KnownEffect("feed_grade", "feed_flow", "feed grade that changes with the feed flow"),
    KnownEffect("tails_valve", "constant", "tails valve characteristic"),
    KnownEffect("tails_valve", "time", "tails valve wear or a blocked valve"),
    KnownEffect("tails_valve", "lag", "slow or sticking tails valve"),
    KnownEffect("tails_valve", "delay", "dead time of the tails valve"),
    KnownEffect("tails_valve", "saturation", "tails valve at its limit"),
    KnownEffect("bubble_size", "constant", "other bubble size than assumed"),
    KnownEffect("bubble_size", "time", f"{_FROTHER}, sparger wear"),
    KnownEffect("bubble_size", "air_flow", "bubble size that grows with air", "rises"),
    KnownEffect("gas_slip", "constant", "other slip of the bubbles than assumed"),
    KnownEffect("gas_slip", "time", f"{_FROTHER}, or viscosity"),
    KnownEffect("gas_slip", "solids", "viscosity that grows with solids", "falls"),
    KnownEffect("burst_rate", "constant", "other bursting rate than assumed"),
    KnownEffect("burst_rate", "time", f"{_FROTHER}: froth stability"),
    KnownEffect("burst_rate", "air_flow", "air-recovery peak and froth collapse"),
    KnownEffect("burst_rate", "valuable_solids", "particles that stabilise the films", "falls"),
    KnownEffect("coalescence", "time", _FROTHER),
    KnownEffect("coalescence", "solids", "froth loading that stabilises bubbles", "falls"),
    KnownEffect("coalescence", "valuable_solids", "froth loading by the mineral that stabilises bubbles", "falls"),
    KnownEffect("coalescence", "air_flow", "coalescence that changes with the gas rate"),
    KnownEffect("growth_exponent", "time", _FROTHER),
    KnownEffect("froth_recovery", "constant", "other froth recovery than assumed"),
    KnownEffect("froth_recovery", "time", "froth recovery that changes with time"),
    KnownEffect("froth_recovery", "froth_depth", "drop-back in a deep froth", "falls"),
    KnownEffect("entrainment", "constant", "other entrainment than assumed"),
    KnownEffect("entrainment", "time", "wash water or fines that change"),
    KnownEffect("entrainment", "feed_flow", "fines that come with the feed", "rises"),
    KnownEffect("settling", "constant", "other settling than assumed"),
    KnownEffect("settling", "time", "particle size that changes"),
    KnownEffect("concentrate_flow", "constant", "other water recovery than assumed"),
    KnownEffect("concentrate_flow", "time", "wash water, or a lip that fouls"),
    KnownEffect("floatability_valuable", "constant", "other floatability of the mineral than assumed"),
    KnownEffect("floatability_valuable", "time", "collector ageing or slimes coating"),
    KnownEffect("floatability_valuable", "air_flow", "detachment in turbulence", "falls"),
    KnownEffect("floatability_gangue", "constant", "other floatability of the gangue than assumed"),
    KnownEffect("floatability_gangue", "time", "activation of the gangue, depressant"),
)
