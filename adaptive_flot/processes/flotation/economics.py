"""What running a flotation cell earns and costs, by named term, for the optimiser and for the account afterwards.

The value is a net smelter return. The smelter pays for the valuable mineral in the concentrate and charges for treating
every kilogram of concentrate, so a richer concentrate earns more from the same metal. Air costs blower energy; reagents
are a placeholder proportional to the feed. All prices are in one currency unit (cu), rates in cu/s. The default prices
are chosen, of the order of copper: chalcopyrite holds 0.346 kg of copper a kilogram.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from adaptive_flot.contracts.economics import OperatingPoint
from adaptive_flot.greybox.model import Model, Parameter

TERMS = ("metal", "treatment", "air", "reagent")
"""Names of the terms; metal earns, the others cost (negative)."""


@dataclass(frozen=True)
class Prices:
    """Economics of a cell by its prices in currency units (cu): the contract `Economics`.

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

    terms: ClassVar[tuple[str, ...]] = TERMS
    typical_rate: ClassVar[float] = 1e-3
    """3.6 cu an hour; the laboratory cell earns about 10."""

    def prices(self) -> list[float]:
        """Prices in the order of the fields."""
        return [getattr(self, f.name) for f in fields(self)]

    def rates(self, point: OperatingPoint, prices: Any) -> dict[str, Any]:
        """Rate of each term [cu/s] at an operating point of the cell (`value_rates`)."""
        return value_rates(
            point.output("concentrate_grade"),
            point.output("recovery"),
            point.input("air_flow"),
            point.input("feed_flow"),
            point.parameter(valuable_feed(point.model).name),
            prices,
        )


def valuable_feed(model: Model) -> Parameter:
    """Concentration of the valuable mineral in the feed [kg/m3]: that of the cell's first mineral."""
    return next(p for p in model.parameters if p.disturbance)


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
