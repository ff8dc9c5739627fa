"""Names, roles and ranges of a model, checked when it is made: a misspelt one must not pass in silence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import get_args

import numpy as np

from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.effects import STATELESS_DRIVERS, Effect, Mode
from adaptive_flot.greybox.lookup import Lookup
from adaptive_flot.greybox.quantities import KnownEffect, Parameter, ParameterRole, Quantity
from adaptive_flot.greybox.scope import Role, Site

GROUPS = {
    "states": Quantity,
    "inputs": Quantity,
    "outputs": Quantity,
    "signals": Quantity,
    "algebraic": Quantity,
    "parameters": Parameter,
    "known_effects": KnownEffect,
}
"""Fields of a model that hold several things, and of what kind these are."""


class Checks(Lookup):
    """What `Model` checks of itself when it is made."""

    states: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    signals: tuple[Quantity, ...]
    algebraic: tuple[Quantity, ...]
    parameters: tuple[Parameter, ...]
    initial_guess: Mapping[str, float]
    max_step_s: float
    drivers: tuple[str, ...]
    late_drivers: tuple[str, ...]
    known_effects: tuple[KnownEffect, ...]
    edges: tuple[str, ...]
    effects: tuple[Effect, ...]

    @property
    def sites(self) -> tuple[Site, ...]:
        """Sites that the equations pass through."""
        raise NotImplementedError

    def check_groups(self) -> None:
        """Check that fields which hold several things are tuples of these.

        Raises
        ------
        ModelError
            A comma was forgotten, or something else stands there.
        """
        for field, kind in GROUPS.items():
            given = getattr(self, field)
            if not isinstance(given, (tuple, list)) or not all(isinstance(item, kind) for item in given):
                example = f'({kind.__name__}("..."),)'
                raise ModelError(
                    f"model '{self.name}': {field} is no tuple of {kind.__name__}; write {field}={example}"
                )

    def check_names(self) -> None:
        """Check the names that the fields of a model refer to, and the words and ranges of its sites and parameters.

        Raises
        ------
        ModelError
            A name, role or mode that does not exist; a scale or a step that is not above zero; a value out of range; a
            range whose ends are exchanged.
        """
        own = (*self.names("inputs"), *self.names("states"), *self.names("signals"))
        drivers, sites = (*own, *STATELESS_DRIVERS, "time"), [site.name for site in self.sites]
        self._known("initial_guess", self.initial_guess, self.names("states"))
        self._known("drivers", self.drivers, own)
        self._known("late_drivers", self.late_drivers, self.names("signals"))
        self._known("edges", self.edges, self.names("outputs"))
        self._known("known_effects", (k.site for k in self.known_effects), sites)
        self._known("known_effects", (k.driver for k in self.known_effects), drivers)
        for site in self.sites:
            self._known(f"site {site.name!r}, role", [site.role], get_args(Role))
            self._known(f"site {site.name!r}, mode", [site.mode], get_args(Mode))
        self._check_ranges()
        searched = {
            e.parameter(c.name) for e in self.effects for c in e.terms
        }  # a search narrows their ranges as it goes
        for p in (p for p in self.parameters if p.name not in searched):
            self._known(f"parameter {p.name!r}, role", [p.role], get_args(ParameterRole))
            if not p.lower <= p.value <= p.upper:
                raise ModelError(
                    f"model '{self.name}': parameter {p.name!r} = {p.value:g} {p.unit} is outside its range "
                    f"[{p.lower:g}, {p.upper:g}]; correct the value or the range"
                )
        scaled: tuple[Quantity | Parameter, ...] = (*self.states, *self.inputs, *self.outputs, *self.parameters)
        for item in scaled:
            if not (item.scale > 0 and np.isfinite(item.scale)):
                raise ModelError(f"model '{self.name}': {item.name!r} has scale {item.scale:g}; give one above zero")
        if not self.max_step_s > 0:
            raise ModelError(f"model '{self.name}': max_step_s is {self.max_step_s:g}; give a step above zero [s]")

    def _check_ranges(self) -> None:
        quantities = (*self.states, *self.inputs, *self.outputs, *self.signals, *self.algebraic)
        ranged: tuple[Quantity | Parameter, ...] = (*quantities, *self.parameters)
        for q in ranged:
            if q.lower > q.upper:
                raise ModelError(
                    f"model '{self.name}': {q.name!r} has lower = {q.lower:g} above upper = {q.upper:g}; exchange them"
                )

    def _known(self, where: str, given: Iterable[str], known: Iterable[str]) -> None:
        listed = list(known)
        for name in given:
            if name not in listed:
                raise ModelError(f"model '{self.name}': {where}: no {name!r}; {near_match(name, listed)}")
