"""Names, places and ranges of a model's quantities."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.quantities import FloatArray, Kind, Parameter, Quantity, check_range


class Lookup:
    """What `Model` answers about its quantities: a kind of quantity is an attribute of that name, a tuple in order."""

    name: str
    inputs: tuple[Quantity, ...]
    parameters: tuple[Parameter, ...]

    def names(self, kind: Kind) -> tuple[str, ...]:
        """Names of one kind of quantity, in vector order."""
        return tuple(q.name for q in getattr(self, kind))

    def index(self, kind: Kind, name: str) -> int:
        """Position of a quantity in its vector; parameters answer to name and symbol.

        Raises
        ------
        ModelError
            No such quantity; the message holds the nearest name.
        """
        for i, quantity in enumerate(getattr(self, kind)):
            if name == quantity.name or (isinstance(quantity, Parameter) and name == quantity.symbol):
                return i
        symbols = (q.symbol for q in getattr(self, kind) if isinstance(q, Parameter) and q.symbol)
        known = near_match(name, (*self.names(kind), *symbols))
        raise ModelError(f"model '{self.name}' has no {name!r} among its {kind}; {known}")

    def indices(self, kind: Kind, names: Iterable[str]) -> list[int]:
        """Positions of several quantities."""
        return [self.index(kind, name) for name in names]

    def expand_parameters(self, names: Iterable[str]) -> tuple[str, ...]:
        """Full parameter names for names, symbols and group prefixes (`floatability` is all its minerals).

        Raises
        ------
        ModelError
            Unknown parameter, or one that is named twice.
        """
        full: list[str] = []
        for name in names:
            group = [p.name for p in self.parameters if p.name.startswith(name + ".")]
            full += group or [self.parameters[self.index("parameters", name)].name]
        twice = next((name for i, name in enumerate(full) if name in full[:i]), None)
        if twice is not None:
            raise ModelError(f"parameter {twice!r} is named twice, alone, by its symbol or in a group; name it once")
        return tuple(full)

    @property
    def parameter_values(self) -> FloatArray:
        """Parameter vector (np,), each in its unit."""
        return np.array([p.value for p in self.parameters], dtype=float)

    def check_inputs(self, inputs: FloatArray, time: FloatArray | None = None, where: str = "inputs") -> None:
        """Check an input table (N, nu) against the physical range of each input.

        Raises
        ------
        RangeError
            Names the first input that leaves its range, the row or time, the value and the range.
        ModelError
            Wrong number of columns.
        """
        check_range(self.inputs, np.atleast_2d(np.asarray(inputs, dtype=float)), time, where)
