"""What a search found, as a change of the model in use: effects with their sizes, and parameters fitted with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model


@dataclass(frozen=True)
class Extension:
    """A change of a model in use.

    Attributes
    ----------
    effects
        Effects to add; none changes nothing.
    parameters
        New values of adapted parameters by full name, each in its unit; those left out are kept.
    initial_state
        State of the extended model at the first row of the record that it was fitted to (nx,); None: states are
        carried over.
    """

    effects: tuple[Effect, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    initial_state: FloatArray | None = None

    def model(self, before: Model) -> Model:
        """The model with the effects; its own parameters stay, the adapted ones are the estimator's."""
        return before.with_effects(self.effects)
