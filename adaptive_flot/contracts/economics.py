"""The contract of an economics object: what running a process earns and costs, as a rate by named term.

The process supplies it, or its user. The optimiser calls it with CasADi expressions, an account with numbers or arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from adaptive_flot.greybox.model import Model


@dataclass(frozen=True)
class OperatingPoint:
    """Quantities of a model at one time, read by name: numbers, arrays over time or CasADi expressions.

    Attributes
    ----------
    model
        The model, which knows the order of its quantities.
    states, inputs, outputs, parameters
        Values in that order, (nx,), (nu,), (ny,) and (np,) or (.., N), each in its unit. Outputs are the true ones:
        what is, not what an instrument with an offset shows.
    """

    model: Model
    states: Any
    inputs: Any
    outputs: Any
    parameters: Any

    def state(self, name: str) -> Any:
        """Value of a state; ModelError for an unknown name."""
        return self.states[self.model.index("states", name)]

    def input(self, name: str) -> Any:
        """Value of an input; ModelError for an unknown name."""
        return self.inputs[self.model.index("inputs", name)]

    def output(self, name: str) -> Any:
        """Value of an output; ModelError for an unknown name."""
        return self.outputs[self.model.index("outputs", name)]

    def parameter(self, name: str) -> Any:
        """Value of a parameter, by name or symbol; ModelError for an unknown name."""
        return self.parameters[self.model.index("parameters", name)]


class Economics(Protocol):
    """What running a process earns and costs, in one currency unit (cu)."""

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms, in the order of a report."""
        ...

    @property
    def typical_rate(self) -> float:
        """Size of a rate that matters [cu/s]: optimisers scale their objective and their penalties by it."""
        ...

    def prices(self) -> Sequence[float]:
        """Prices (k,), which may change without a rebuild of what was built from `rates`."""
        ...

    def rates(self, point: OperatingPoint, prices: Any) -> Mapping[str, Any]:
        """Rate of each term [cu/s], positive where it earns, at prices (k,) in the order of `prices()`."""
        ...
