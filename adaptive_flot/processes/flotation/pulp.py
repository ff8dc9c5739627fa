"""Pulp zone: density, viscosity, bubble slip and the bubble size at the interface (Part I, Section 3).

Part I is Quintanilla et al., Minerals Engineering 173 (2021). Arguments and results are CasADi expressions
in SI units; `eps` is the gas holdup of each bubble class, the fraction of the aerated pulp that it fills.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

SLIP_EXPONENT = -1.39
"""Exponent of (1 - eps_k) in the slip velocity (Part I, 32)."""


def pulp_density(solids_fraction: ca.SX, solids_density: ca.SX, water_density: ca.SX) -> ca.SX:
    """Density of the gas-free pulp [kg/m3]: rho_p = phi rho_s + (1 - phi) rho_w (Part I, 34)."""
    return solids_fraction * solids_density + (1 - solids_fraction) * water_density


def pulp_viscosity(solids_fraction: ca.SX, water_viscosity: ca.SX) -> ca.SX:
    """Viscosity of the pulp [Pa s]: mu_p = mu_w exp(2.5 phi / (1 - 0.609 phi)) (Part I, 36)."""
    return water_viscosity * ca.exp(2.5 * solids_fraction / (1 - 0.609 * solids_fraction))


def slip_velocity(diameter: ca.SX, holdup: ca.SX, density: ca.SX, viscosity: ca.SX, gravity: ca.SX) -> ca.SX:
    """Slip velocity of one bubble class [m/s]: v = g rho_p d^2 / (18 mu_p) (1 - eps)^-1.39 (Part I, 32)."""
    return gravity * density * diameter**2 / (18 * viscosity) * (1 - holdup) ** SLIP_EXPONENT


@dataclass(frozen=True)
class GasOutflow:
    """Gas that leaves the pulp: velocity v_out [m/s] and the interface bubble size d_int [m]."""

    velocity: ca.SX
    interface_bubble_size: ca.SX


def gas_outflow(diameters: list[ca.SX], holdups: list[ca.SX], slips: list[ca.SX]) -> GasOutflow:
    """v_out = sum v_k eps_k (Part I, 33); d_int = v_out / sum(v_k eps_k / d_k), a Sauter mean (Part I, 38)."""
    flux = [v * eps for v, eps in zip(slips, holdups, strict=True)]
    velocity = sum(flux[1:], flux[0])
    area = [f / d for f, d in zip(flux, diameters, strict=True)]
    return GasOutflow(velocity, velocity / sum(area[1:], area[0]))
