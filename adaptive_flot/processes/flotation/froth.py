"""Froth zone: bubble growth, air recovery, froth recovery, entrainment and the concentrate flow.

Sources: *paper* is Gonzalez & Quintanilla (grey-box recursive identification); Part I is Quintanilla et al. (2021).
Arguments and results are CasADi expressions in SI units. `a` is alpha* = 1 - v_b / v_g*, the air recovery from the
bursting rate; `vg` is v_g*, the interfacial gas velocity.

The closures are printed in two branches, alpha* < 0.5 and alpha* >= 0.5. R_f and Q_conc are continuous there, the
printed R_ent is not (a factor sqrt 2 in its exponent). An optimiser needs a smooth model, so the branches are blended
by a logistic of steepness 50 in alpha*, as in Part I. In the paper's range (alpha* 0.08 to 0.21) the first branch is
met to 1e-6.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

BLEND_STEEPNESS = 50.0
BRANCH_SWITCH = 0.5
HINDERED_SETTLING = 4.65


def bursting_rate(jg: ca.SX, a: ca.SX, b: ca.SX, c: ca.SX) -> ca.SX:
    """v_b = a + b j_g + c j_g^2 [m/s], j_g the superficial gas velocity (Neethling & Brito-Parada 2018)."""
    return a + b * jg + c * jg**2


def branch_weight(a: ca.SX) -> ca.SX:
    """Weight of the branch alpha* >= 0.5, between 0 and 1."""
    return 1 / (1 + ca.exp(-BLEND_STEEPNESS * (a - BRANCH_SWITCH)))


def froth_bubble_size(d_int: ca.SX, residence_time: ca.SX, n: ca.SX, coalescence_rate: ca.SX) -> ca.SX:
    """d_froth = (n C tau_f + d_int^n)^(1/n) [m] (paper, db-froth); tau_f = h_f / v_g* [s]."""
    return (n * coalescence_rate * residence_time + d_int**n) ** (1 / n)


def drainage_constant(density: ca.SX, viscosity: ca.SX, gravity: ca.SX, drag: ca.SX) -> ca.SX:
    """k_1 = rho_p g / (3 C_PB mu_p) [1/(m s)] (Part I, 45)."""
    return density * gravity / (3 * drag * viscosity)


def settling_velocity(
    density: ca.SX, diameter: ca.SX, solids_fraction: ca.SX, viscosity: ca.SX, gravity: ca.SX, water_density: ca.SX
) -> ca.SX:
    """Hindered settling in the froth [m/s]: g (rho_i - rho_w) d^2 (1 - phi)^4.65 / (18 mu_p 3) (Part I, 55)."""
    stokes = gravity * (density - water_density) * diameter**2 / (18 * viscosity)
    settling: ca.SX = stokes * (1 - solids_fraction) ** HINDERED_SETTLING / 3
    return settling


def axial_dispersion(jg: ca.SX, k1: ca.SX, peclet: ca.SX) -> ca.SX:
    """D_axial = j_g^1.5 / (sqrt(k_1 (sqrt 3 - pi/2)) Pe) [m2/s] (Part I, 58)."""
    dispersion: ca.SX = jg**1.5 / (ca.sqrt(k1 * (np.sqrt(3) - np.pi / 2)) * peclet)
    return dispersion


def froth_recovery(a: ca.SX, vg: ca.SX, settling: ca.SX, d_int: ca.SX, d_froth: ca.SX) -> ca.SX:
    """Froth recovery, the fraction of attached particles that overflows [-] (paper, rf).

    R_f = (alpha*(1 - alpha*) v_g* / v_set)^0.25 (d_int / d_froth)^0.5; above alpha* = 0.5 with 1/4 in the place of
    alpha*(1 - alpha*).
    """
    w = branch_weight(a)
    low = ca.sqrt(ca.sqrt(a * (1 - a) * vg / settling))
    high = ca.sqrt(ca.sqrt(vg / (4 * settling)))
    return ((1 - w) * low + w * high) * ca.sqrt(d_int / d_froth)


def entrainment(a: ca.SX, vg: ca.SX, settling: ca.SX, froth_depth: ca.SX, dispersion: ca.SX) -> ca.SX:
    """Entrainment factor, mineral per concentrate water over that in the pulp [-] (paper, ent).

    R_ent = exp(-v_set^1.5 h_f / (D sqrt(v_g* (1 - alpha*)))); above alpha* = 0.5 exp(-2 v_set^1.5 h_f / (D sqrt v_g*)).
    """
    w = branch_weight(a)
    drop = settling**1.5 * froth_depth / dispersion
    return (1 - w) * ca.exp(-drop / ca.sqrt(vg * (1 - a))) + w * ca.exp(-2 * drop / ca.sqrt(vg))


def concentrate_flow(a: ca.SX, vg: ca.SX, area: ca.SX, k1: ca.SX, d_froth: ca.SX, plateau_border: ca.SX) -> ca.SX:
    """Q_conc = 6.815 A v_g*^2 (1 - alpha*) alpha* / (k_1 d_froth^2) [m3/s], 1/4 above 0.5 (paper, Qconc)."""
    w = branch_weight(a)
    return plateau_border * area * vg**2 / (k1 * d_froth**2) * ((1 - w) * a * (1 - a) + w / 4)
