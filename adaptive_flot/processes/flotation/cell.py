"""The flotation cell: 2 + I + K states, one algebraic variable of index 1, any number of minerals and bubble classes.

Source of the equations: Gonzalez & Quintanilla (the *paper*) with the closures of Quintanilla et al. (2021, Part I).
Two of its printed equations are read in the only way that is consistent:

* the gas balance holds for r_k, gas volume per volume of **gas-free** pulp; eps_k = r_k / (1 + sum r) is the holdup;
* the level loop is stable with `+ (k_p / tau_i) (h_p - h_p_SP)`, not with the printed minus sign.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.greybox.model import Model, Quantity, Scope
from adaptive_flot.processes.flotation import froth, pulp
from adaptive_flot.processes.flotation.cell_file import default_cell
from adaptive_flot.processes.flotation.effects import KNOWN_EFFECTS
from adaptive_flot.processes.flotation.parameters import Cell


def make_model(cell: Cell | None = None) -> Model:
    """Flotation model of a cell (default: the 87-litre laboratory cell of the paper).

    =========== ============================================================ =======
    vector      entries                                                      unit
    =========== ============================================================ =======
    states      tails_flow, level, m_<mineral> (I), gas_ratio_<k> (K)        m3/s, m, kg, -
    inputs      air_flow, feed_flow, level_setpoint                          m3/s, m3/s, m
    outputs     concentrate_grade, recovery, tails_flow, level,              -, -, m3/s, m,
                concentrate_flow, air_recovery                               m3/s, -
    algebraic   interfacial_gas_velocity                                     m/s
    =========== ============================================================ =======

    With two minerals the masses are named `m_valuable` and `m_gangue`. The first mineral is the valuable one.
    """
    cell = cell or default_cell()
    height = cell.value("height")
    masses = mass_names(cell.minerals)
    ratios = [f"gas_ratio_{k + 1}" for k in range(cell.bubble_classes)]
    flow = cell.value("cross_section_area") * 0.01  # 1 cm/s of superficial velocity: a large flow of pulp
    air_low, air_high = cell.operation["air_flow_valid"]
    (run_low, run_high), fed = cell.operation["air_flow_limits"], cell.operation["feed_flow"][0]

    states = [
        Quantity("tails_flow", "m3/s", "tails flow asked for by the level loop", -flow, flow, 1e-4),
        Quantity("level", "m", "pulp height", 0.0, height, 0.1),
        *(Quantity(m, "kg", f"{n} in the pulp", 0.0, scale=1.0) for m, n in zip(masses, cell.minerals, strict=True)),
        *(Quantity(r, "-", "gas volume of a bubble class over gas-free pulp volume", 0.0, 1.0, 0.01) for r in ratios),
    ]
    return Model(
        name="flotation",
        states=tuple(states),
        inputs=(
            Quantity("air_flow", "m3/s", "air flow", air_low, air_high, 1e-3, (run_low, run_high)),
            Quantity("feed_flow", "m3/s", "feed flow", 0.0, flow, 1e-4, usual=(0.2 * fed, 5 * fed)),
            Quantity(
                "level_setpoint",
                "m",
                "pulp height set-point",
                1e-3 * height,
                height * (1 - 1e-3),
                0.1,
                usual=(0.3 * height, height),
            ),
        ),
        parameters=cell.parameters,
        outputs=(
            Quantity(
                "concentrate_grade", "-", "valuable mineral in the concentrate by mass", 0.0, 1.0, 0.1, (0.01, 1.0)
            ),
            Quantity(
                "recovery", "-", "valuable mineral to concentrate over valuable fed", 0.0, np.inf, 0.1, (0.1, 1.5)
            ),
            Quantity("tails_flow", "m3/s", "tails flow", -flow, flow, 1e-5, (0.1 * fed, 5 * fed)),
            Quantity("level", "m", "pulp height", 0.0, height, 0.01, (0.3 * height, height)),
            Quantity("concentrate_flow", "m3/s", "concentrate flow", 0.0, flow, 1e-6, (1e-3 * fed, fed)),
            Quantity("air_recovery", "-", "air that overflows over air fed", 0.0, 1.0, 0.01, (0.01, 1.0)),
        ),
        signals=(
            Quantity("alpha_star", "-", "air recovery from the bursting rate", 0.0, 1.0, 0.1),
            Quantity("interfacial_gas_velocity", "m/s", "gas velocity at the interface", 0.0, scale=0.01),
            Quantity("interface_bubble_size", "m", "bubble size at the interface", 0.0, scale=1e-3),
            Quantity("froth_bubble_size", "m", "bubble size at the top of the froth", 0.0, scale=1e-2),
            Quantity("froth_depth", "m", "froth depth", 0.0, height, 0.1),
            Quantity("solids", "kg/m3", "minerals in the pulp", 0.0, scale=100.0),
            Quantity("valuable_solids", "kg/m3", "valuable mineral in the pulp", 0.0, scale=10.0),
            Quantity("pulp_grade", "-", "valuable mineral in the solids of the pulp by mass", 0.0, 1.0, 0.01),
            Quantity("grade", "-", "valuable mineral in the solids of the concentrate by mass", 0.0, 1.0, 0.01),
        ),
        algebraic=(Quantity("interfacial_gas_velocity", "m/s", "gas velocity at the interface", 0.0, scale=0.01),),
        drivers=("air_flow", "feed_flow", "level", "froth_depth", "grade", "solids", "valuable_solids"),
        late_drivers=("grade",),
        known_effects=KNOWN_EFFECTS,
        max_step_s=_max_step(cell),
        equations=lambda m: _equations(m, masses, ratios),
        initial_guess={
            "tails_flow": 1.6e-4,
            "level": 0.8 * height,
            **dict.fromkeys(masses, 1.0),
            **dict.fromkeys(ratios, 0.1 / len(ratios)),
        },
    )


TRACE = 1e-12
"""Mass [kg] that keeps the grade of an empty pulp finite, and fraction of the feed's minerals that counts as present.
The grade of an empty pulp is then that of the first mineral to arrive, not 0/0. Any other changes in the twelfth
digit."""
FELT = 1 / 3
"""Fraction of the froth's residence time after which the grade acts back: that of its top, where bubbles burst.
An effect that follows at once would close an algebraic loop through the whole froth."""
SHALLOWEST = 1e-3
"""Froth depth [m] below which the residence time of the froth is that of this depth."""
FASTEST_DECAY = 2.0
"""Largest decay rate times step at which the fast step keeps its accuracy (see `SERIES_TERMS` there)."""


def _max_step(cell: Cell) -> float:
    """Step [s] in which the largest bubbles leave a half full cell by at most `FASTEST_DECAY` e-folds; at most 1 s."""
    value = {p.name: ca.SX(p.value) for p in cell.parameters}
    phi = value["solids_fraction"]
    rho_p = pulp.pulp_density(phi, value["solids_density"], value["water_density"])
    mu_p = pulp.pulp_viscosity(phi, value["water_viscosity"])
    used = [str(k + 1) for k in range(cell.bubble_classes) if cell.value(f"bubble_number.{k + 1}") > 0]
    largest = ca.SX(max(cell.value(f"bubble_diameter.{k}") for k in used))
    fastest = float(pulp.slip_velocity(largest, ca.SX(0.0), rho_p, mu_p, value["gravity"]))
    return min(1.0, FASTEST_DECAY * 0.5 * cell.value("height") / fastest)


def mass_names(minerals: tuple[str, ...]) -> list[str]:
    """State names of the masses: valuable and gangue for two minerals, else their own names."""
    return ["m_valuable", "m_gangue"] if len(minerals) == 2 else [f"m_{name}" for name in minerals]


def _level_loop(m: Scope, level: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Level as the loop measures it [m], and the tails flow that it asks for [m3/s].

    The state `tails_flow` follows the true level; what the sensor adds to it the proportional part passes on as it
    comes. As a rate it would be lost where it jumps with an input, which has no rate.
    """
    measured = m.site("level_sensor", level, "sensor", "offset", unit="m")
    return measured, m.state("tails_flow") + m.parameter("proportional_gain") * (measured - level)


def _equations(m: Scope, masses: list[str], ratios: list[str]) -> None:
    area, height = m.parameter("cross_section_area"), m.parameter("height")
    phi, gravity = m.parameter("solids_fraction"), m.parameter("gravity")
    h_p = m.state("level")
    mass = [m.state(name) for name in masses]
    r = [m.state(name) for name in ratios]
    v_pulp = area * h_p
    total_mass = sum(mass[1:], mass[0])

    # What effects may depend on is named first: these need states and inputs only.
    h_f = m.signal("froth_depth", height - h_p)
    m.signal("solids", total_mass / v_pulp)
    m.signal("valuable_solids", mass[0] / v_pulp)
    m.signal("pulp_grade", mass[0] / (total_mass + TRACE))

    q_air = m.site("air_flow", m.input("air_flow"), "actuator", unit="m3/s")
    q_feed = m.site("feed_flow", m.input("feed_flow"), "feed", unit="m3/s")
    level, demand = _level_loop(m, h_p)
    q_tails = m.site("tails_valve", demand, "actuator", unit="m3/s")
    jg = q_air / area

    # Pulp
    rho_p = pulp.pulp_density(phi, m.parameter("solids_density"), m.parameter("water_density"))
    mu_p = pulp.pulp_viscosity(phi, m.parameter("water_viscosity"))
    gas = sum(r[1:], r[0])
    eps = [rk / (1 + gas) for rk in r]
    d = [m.site("bubble_size", dk, unit="m") for dk in m.parameter_group("bubble_diameter")]
    slip = [pulp.slip_velocity(dk, ek, rho_p, mu_p, gravity) for dk, ek in zip(d, eps, strict=True)]
    v = [m.site("gas_slip", vk, unit="m/s") for vk in slip]
    out = pulp.gas_outflow(d, eps, v)
    d_int = m.signal("interface_bubble_size", out.interface_bubble_size)

    # Froth
    vg = m.signal("interfacial_gas_velocity", m.algebraic("interfacial_gas_velocity"))
    v_b = froth.bursting_rate(jg, m.parameter("burst_a"), m.parameter("burst_b"), m.parameter("burst_c"))
    v_b = m.site("burst_rate", v_b, unit="m/s")
    alpha = m.signal("alpha_star", 1 - v_b / vg)
    n = m.site("growth_exponent", m.parameter("growth_exponent"), unit="-")
    growth = m.site("coalescence", m.parameter("coalescence_rate"), unit="m^n/s")
    d_froth = m.signal("froth_bubble_size", froth.froth_bubble_size(d_int, h_f / vg, n, growth))
    k1 = froth.drainage_constant(rho_p, mu_p, gravity, m.parameter("drag_coefficient"))
    dispersion = froth.axial_dispersion(jg, k1, m.parameter("peclet"))
    q_conc = froth.concentrate_flow(alpha, vg, area, k1, d_froth, m.parameter("plateau_border"))
    q_conc = m.site("concentrate_flow", q_conc, unit="m3/s")
    # v_g* = (Q_feed - Q_tails - Q_conc + Q_air) / A (paper, vg*); the concentrate is a small part of it
    m.residual(
        "interfacial_gas_velocity", vg - (q_feed - q_tails - q_conc + q_air) / area, (q_feed - q_tails + q_air) / area
    )

    # Minerals: flow to the concentrate F_i and mass balance (paper, mass-balance)
    feed = m.parameter_group("feed_concentration")
    feed[0] = m.site("feed_grade", feed[0], "feed", unit="kg/m3")
    s_b = 6 * vg / d_int  # bubble surface area flux (Part I, 53)
    to_concentrate, graded = [], []
    for i, (mi, p_i) in enumerate(zip(mass, m.parameter_group("floatability"), strict=True)):
        p_i = m.site("floatability_valuable" if i == 0 else "floatability_gangue", p_i, unit="-")
        v_set = froth.settling_velocity(
            m.parameter_group("mineral_density")[i],
            m.parameter_group("particle_diameter")[i],
            phi,
            mu_p,
            gravity,
            m.parameter("water_density"),
        )
        v_set = m.site("settling", v_set, unit="m/s")
        r_f = m.site("froth_recovery", froth.froth_recovery(alpha, vg, v_set, d_int, d_froth), unit="-")
        r_ent = m.site("entrainment", froth.entrainment(alpha, vg, v_set, h_f, dispersion), unit="-")
        carried = m.parameter("volume") * p_i * s_b * r_f + q_conc * r_ent  # per concentration in the pulp
        flow = mi / v_pulp * carried
        to_concentrate.append(flow)
        graded.append((mi / v_pulp + TRACE * feed[i]) * carried)
        m.derivative(masses[i], feed[i] * q_feed - mi / v_pulp * q_tails - flow)

    # Level and gas (paper, hp and gas-holdup)
    m.derivative("level", vg - out.velocity)
    numbers = m.parameter_group("bubble_number")
    total_number = sum(numbers[1:], numbers[0])
    for name, rk, vk, number in zip(ratios, r, v, numbers, strict=True):
        balance = q_air * number / total_number - area * vk * rk / (1 + gas) - (q_feed - q_tails - q_conc) * rk
        m.derivative(name, (1 + gas) / v_pulp * balance, decay=-vk / h_p)

    # Level loop (paper, Qtails, with the stable sign); the part of the sensor is in `_level_loop`
    gain = m.parameter("proportional_gain")
    error = level - m.input("level_setpoint")
    m.derivative("tails_flow", gain * m.time_derivative(h_p) + gain / m.parameter("integral_time") * error)

    grade = graded[0] / sum(graded[1:], graded[0])  # paper, grade
    m.late_signal("grade", grade, vg / ca.fmax(h_f, SHALLOWEST) / FELT)
    m.output("concentrate_grade", m.site("grade_sensor", grade, "sensor", "offset", unit="-"))
    m.output("recovery", to_concentrate[0] / (feed[0] * q_feed))
    m.output("tails_flow", m.site("tails_sensor", q_tails, "sensor", unit="m3/s"))
    m.output("level", level)
    m.output("concentrate_flow", m.site("concentrate_flow_sensor", q_conc, "sensor", unit="m3/s"))
    m.output("air_recovery", m.site("air_recovery_sensor", alpha * vg * area / q_air, "sensor", unit="-"))
