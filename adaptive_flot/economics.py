"""What running a cell earns and costs, by named term: one function for the optimiser and for the account afterwards.

The value is a net smelter return: the smelter pays for the valuable mineral in the concentrate and charges for treating
every kilogram of concentrate, so that a richer concentrate earns more from the same metal; air costs blower energy;
reagents are a placeholder proportional to the feed. All prices are in one currency unit (cu), rates in cu/s. The
default prices are chosen, of the order of copper: chalcopyrite holds 0.346 kg of copper a kilogram.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

TERMS = ("metal", "treatment", "air", "reagent")
"""Names of the terms; metal earns, the others cost (negative)."""


@dataclass(frozen=True)
class Prices:
    """Prices in currency units (cu).

    Attributes
    ----------
    metal
        Paid per kg of valuable mineral in the concentrate [cu/kg].
    treatment
        Charged per kg of concentrate minerals [cu/kg].
    air
        Per m3 of air [cu/m3].
    reagent
        Per m3 of feed [cu/m3]; a placeholder until reagents are inputs.
    """

    metal: float = 2.5
    treatment: float = 0.10
    air: float = 1e-3
    reagent: float = 0.05

    def values(self) -> list[float]:
        """Prices in the order of the fields."""
        return [getattr(self, f.name) for f in fields(self)]


def value_rates(
    grade: Any, recovery: Any, air_flow: Any, feed_flow: Any, feed_concentration: Any, prices: Any
) -> dict[str, Any]:
    """Rate of each term [cu/s].

    Parameters
    ----------
    grade, recovery
        Concentrate grade and recovery of the valuable mineral [-].
    air_flow, feed_flow
        [m3/s].
    feed_concentration
        Valuable mineral in the feed [kg/m3].
    prices
        Metal, treatment, air, reagent, in the order of `Prices`. Numbers, arrays or CasADi expressions all through.
    """
    metal, treatment, air, reagent = (prices[i] for i in range(4))
    valuable = recovery * feed_concentration * feed_flow  # kg/s into the concentrate
    return {
        "metal": metal * valuable,
        "treatment": -treatment * valuable / grade,
        "air": -air * air_flow,
        "reagent": -reagent * feed_flow,
    }
