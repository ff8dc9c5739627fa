"""The model in use: extended and reverted between two cycles, by a request of a person."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from adaptive_flot.contracts import Estimate, Prior
from adaptive_flot.errors import AdaptiveFlotError, LinkError
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.link.cycle import Cycle, CycleState
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.store.beside import ModelChange
from adaptive_flot.live.store.resume import Extension


@dataclass(frozen=True)
class _Before:
    """A cycle that was left, and the parameters that its estimator had."""

    cycle: Cycle
    parameters: FloatArray


class ModelUse:
    """The cycle in use, and those before it.

    A longer model is built in a thread of its own, while the cycles go on with the one in use.

    Parameters
    ----------
    link
        The link file and its scenario.
    extensions
        How the model that was in use before a restart came about; empty for the scenario's model.

    Attributes
    ----------
    cycle
        The cycle in use.

    Raises
    ------
    LinkError
        The plug-ins do not take the extended model any more.
    """

    def __init__(self, link: Link, extensions: tuple[Extension, ...] = ()) -> None:
        self.cycle = Cycle(link)
        self._before: list[_Before] = []
        for extension in extensions:
            self._before.append(_Before(self.cycle, extension.before))
            try:
                self.cycle = Cycle(link, extension.effects)
            except AdaptiveFlotError as error:
                raise LinkError(
                    f"{link.path}: the extended model that was in use can not be built ({error}); correct it, or give "
                    "another database to start with the scenario's model"
                ) from error
        self._building: asyncio.Task[Cycle] | None = None

    @property
    def extended(self) -> bool:
        """The model in use is longer than the scenario's."""
        return bool(self._before)

    def build(self, effects: tuple[Effect, ...]) -> None:
        """Begin to build the cycle with further effects."""
        link, all_effects = self.cycle.link, (*self.cycle.effects, *effects)
        self._building = asyncio.create_task(asyncio.to_thread(Cycle, link, all_effects))

    def built(self) -> str | None:
        """Empty when the cycle is built, words where it failed, None while nothing is ready."""
        if self._building is None or not self._building.done():
            return None
        error = self._building.exception()
        if error is None:
            return ""
        self._building = None
        return f"{type(error).__name__}: {error}"

    def apply(self, state: CycleState, known: Estimate, person: str) -> tuple[CycleState, ModelChange]:
        """Go on with the cycle that was built, from an estimate with its model."""
        assert self._building is not None and state.sample is not None and state.estimation.estimate is not None
        before = _Before(self.cycle, state.estimation.estimate.parameters)
        made, self._building = self._building.result(), None
        after = self._go_on(made, state, known.state, known.parameters, known.covariance, person)
        self.cycle = made
        self._before.append(before)
        return after

    def revert(self, state: CycleState, person: str) -> tuple[CycleState, ModelChange]:
        """Go back to the cycle before, with the parameters that it had."""
        before = self._before.pop()
        self.cycle = before.cycle
        estimate = state.estimation.estimate
        assert estimate is not None
        own = estimate.state[: len(self.cycle.model.states)]
        return self._go_on(self.cycle, state, own, before.parameters, estimate.covariance, person)

    @staticmethod
    def _go_on(
        cycle: Cycle, state: CycleState, x: FloatArray, parameters: FloatArray, covariance: FloatArray, person: str
    ) -> tuple[CycleState, ModelChange]:
        """Start anew with another model, of whose errors only the noise is known: their colour was another model's."""
        began = state.estimation.began
        assert state.sample is not None and began is not None
        prior = Prior(
            state.sample.time,
            x,
            parameters,
            covariance,
            began.noise_std,
            core_noise_std=began.core_noise_std,
            ongoing=True,
        )
        return cycle.go_on(state, prior), ModelChange(cycle.effects, prior, person)
