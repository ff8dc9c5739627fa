"""Numbers of the 87-litre laboratory cell, copied once by hand; nothing here is read from the package's cell files.

Sources: *paper* = Gonzalez & Quintanilla, "Grey-box Recursive Parameter Identification of a Nonlinear Dynamic Model for
Mineral Flotation"; *part I / II* = Quintanilla et al., Minerals Engineering 173 (2021), as found in public
implementations; *chosen* = not published, chosen for the grades and recoveries of a rougher cell. SI units.
"""

from __future__ import annotations

import math

AREA, CELL_VOLUME, CELL_HEIGHT = 0.18, 0.087, 0.48  # m2, m3, m; part II
SOLIDS_FRACTION = 0.2  # part II
SOLIDS_DENSITY, WATER_DENSITY = 2650.0, 1000.0  # kg/m3; chosen, physical
WATER_VISCOSITY, GRAVITY = 1.0e-3, 9.81  # Pa s, m/s2
BUBBLE_DIAMETERS = (2.0e-4, 4.0e-4, 6.0e-4, 8.0e-4, 1.0e-3)  # m; part II
BUBBLE_NUMBERS = (500, 1300, 1700, 2000, 1200)  # part II
GROWTH_EXPONENT, COALESCENCE_RATE = 1.0, 6.38e-4  # n [-], C [m^n/s]; paper
BURST = (-6.06e-4, 0.9182, 0.0)  # a [m/s], b [-], c [s/m]; part II
DRAG, PLATEAU_BORDER, PECLET = 50.0, 6.815, 0.15  # part I, paper, part I
FLOATABILITY = (2.8e-4, 3.0e-6)  # chalcopyrite: part II, quartz: chosen
PARTICLE_DIAMETERS = (7.5e-5, 7.3e-5)  # m; part II
MINERAL_DENSITIES = (4200.0, 2650.0)  # kg/m3; physical
FEED_CONCENTRATIONS = (10.6, 519.4)  # kg/m3; chosen: 2 % chalcopyrite by mass
LEVEL_GAIN, LEVEL_INTEGRAL_TIME = 3.0e-3, 150.0  # m2/s, s; chosen
FEED_FLOW = 1.67e-4  # m3/s; part II
AIR_LIMITS = (9.05e-4, 2.17e-3)  # m3/s; paper, unit and second value corrected
LEVEL_LIMITS = (0.33, 0.42)  # m; paper

AIR_SHARES = tuple(number / sum(BUBBLE_NUMBERS) for number in BUBBLE_NUMBERS)
PULP_DENSITY = SOLIDS_FRACTION * SOLIDS_DENSITY + (1.0 - SOLIDS_FRACTION) * WATER_DENSITY  # kg/m3; part I, 34


def pulp_viscosity(solids_fraction: float = SOLIDS_FRACTION, water_viscosity: float = WATER_VISCOSITY) -> float:
    """Viscosity of the pulp [Pa s] (part I, 36)."""
    return water_viscosity * math.exp(2.5 * solids_fraction / (1.0 - 0.609 * solids_fraction))


PULP_VISCOSITY = pulp_viscosity()
STOKES = tuple(GRAVITY * PULP_DENSITY * d**2 / (18.0 * PULP_VISCOSITY) for d in BUBBLE_DIAMETERS)  # m/s; part I, 32
FILM_DRAINAGE = PULP_DENSITY * GRAVITY / (3.0 * DRAG * PULP_VISCOSITY)  # k_1, 1/(m s); part I, 45
SETTLING = tuple(  # hindered settling in the froth, m/s; part I, 55
    GRAVITY * (rho - WATER_DENSITY) * d**2 * (1.0 - SOLIDS_FRACTION) ** 4.65 / (54.0 * PULP_VISCOSITY)
    for rho, d in zip(MINERAL_DENSITIES, PARTICLE_DIAMETERS, strict=True)
)
