"""What happens beside the cycles: persons' requests, alarms, shadows, and the card of discovery.

Nothing here writes to the plant. A request of a person ends in what the cycle is given: how far it may go, and with
which model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from adaptive_flot.contracts import Prior
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.alarms import Alarms, acknowledged, after_cycle, conditions, lasting, watched_limits
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link.cycle import CycleState
from adaptive_flot.live.link_file import TRIED, Link
from adaptive_flot.live.link_keys import MODES
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.requests import Action, Answered, Request
from adaptive_flot.live.running.model_use import ModelUse
from adaptive_flot.live.running.progress import Card, Stage
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.shadow.process import Shadow, ShadowView, task_of
from adaptive_flot.live.shadow.worker import Make, ShadowPlan, make_stepper
from adaptive_flot.live.store.beside import ModelChange, ShadowResult

FEWEST_ROWS = 30
"""Rows that an extended model must have run in shadow before it can be applied."""
ITSELF = "link file"
"""Who applies where the link file lets the link do so."""


class Desk:
    """What happens beside the cycles of a link.

    Parameters
    ----------
    link
        The link file and its scenario.
    use
        The model in use.
    make
        Makes what runs in shadow, in its process.
    inputs_since
        See `LiveDiscovery.inputs_since`.
    allowed
        Where the page's switch stands at the start.

    Attributes
    ----------
    allowed
        How far a person at the page lets the link go.
    alarms
        The alarms by key.
    card
        What discovery found last; None before.
    """

    def __init__(
        self,
        link: Link,
        use: ModelUse,
        make: Make = make_stepper,
        inputs_since: Callable[[float], FloatArray | None] = lambda time: None,
        allowed: Mode = Mode.CLOSED,
    ) -> None:
        self.allowed = allowed
        self.alarms: Alarms = {}
        self.card: Card | None = None
        self.use = use
        self._link, self._make, self._inputs_since = link, make, inputs_since
        self._shadows: dict[str, Shadow] = {}
        self._lasting: dict[str, int] = {}
        self._said: dict[str, str] = {}
        self._applies = self._reverts = ""
        self._limits = watched_limits(link.scenario)

    def answer(self, requests: Sequence[Request]) -> tuple[Answered, ...]:
        """Carry out what persons ask for; what came of each."""
        answers: dict[Action, Callable[[Request], str]] = {
            Action.SWITCH: self._switch,
            Action.ACKNOWLEDGE: self._acknowledge,
            Action.SHADOW: self._try,
            Action.APPLY: self._apply,
            Action.REVERT: self._revert,
        }
        return tuple(Answered(request, answers[request.action](request)) for request in (*requests, *self._own()))

    def change_model(self, state: CycleState) -> tuple[CycleState, ModelChange | None]:
        """Take up or leave an extension, where one was asked for and is ready."""
        ready = self.use.built()
        if state.sample is None or state.estimation.estimate is None:
            return state, None
        if self._reverts:
            return self._reverted(state)
        if self.card is None or not self._applies or ready is None:
            return state, None
        person, self._applies = self._applies, ""
        return self._taken_up(self.card, state, ready, person)

    def _reverted(self, state: CycleState) -> tuple[CycleState, ModelChange]:
        """The model before; what was found beside the one that is left no longer holds."""
        person, self._reverts = self._reverts, ""
        if TRIED in self._shadows:
            self._shadows.pop(TRIED).close()
        applied = self.card is not None and self.card.stage is Stage.APPLIED
        self.card = replace(self.card, stage=Stage.REVERTED, by=person) if self.card is not None and applied else None
        return self.use.revert(state, person)

    def _taken_up(
        self, card: Card, state: CycleState, problem: str, person: str
    ) -> tuple[CycleState, ModelChange | None]:
        """The extended model, where it could be built and its shadow stands at numbers; else the one in use stays."""
        tried = self._tried()
        known = None if tried is None or tried.newest is None else tried.newest.estimate
        if tried is None or known is None:
            problem = problem or "it does not run in shadow any more"
        elif not all(np.isfinite(part).all() for part in (known.state, known.parameters, known.covariance)):
            problem = problem or "its estimate in shadow is not finite"
        elif not problem:
            try:
                changed = self.use.apply(state, known, person)
            except Exception as error:  # whatever a plug-in raises, the cycles go on with the model in use
                problem = f"{type(error).__name__}: {error}"
            else:
                self.card = replace(card, stage=Stage.APPLIED, by=person, errors=tried.compared.errors)
                self._shadows.pop(TRIED).close()
                return changed
        self.card = replace(card, stage=Stage.FOUND)
        self._said["model"] = f"not applied: {problem}"
        return state, None

    def after(
        self,
        outcome: Outcome,
        began: Prior | None,
        finding: Finding | None,
        further: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Look at a cycle, and at what else is wrong: feed the shadows, set alarms, take up what discovery found.

        `began` is what the acting estimator was started with.
        """
        if outcome.estimate is not None and outcome.sample is not None and began is not None:
            for name, part in self._link.file.shadows.items():
                if name not in self._shadows:
                    self._start(ShadowPlan(name, part.estimator, part.controller))
            task = task_of(outcome, began, self._link.scenario.model.names("inputs"))
            for shadow in self._shadows.values():
                shadow.feed(task, outcome.estimate)
        time = float("nan") if outcome.sample is None else outcome.sample.time
        building = self.card is not None and self.card.stage is Stage.BUILDING  # what is applied is what was asked for
        if finding is not None and not building and (self.card is None or finding is not self.card.finding):
            self.card = Card(finding, time)
        wrong = conditions(outcome, self._limits) | dict(further)
        for role, shadow in self._shadows.items():
            if not shadow.view().runs:
                wrong[f"shadow {role}"] = f"shadow {role} {shadow.view().status}"
        if self.card is not None and self.card.stage is Stage.FOUND and self.card.finding.effects:
            wrong["discovery"] = f"discovery: {self.card.finding.word}; see the card"
        self._lasting, wrong = lasting(self._lasting, wrong)
        self.alarms, said = after_cycle(self.alarms, wrong, time)
        self._said |= said

    def said(self) -> dict[str, str]:
        """Words on alarms and models since the last call, by key."""
        said, self._said = self._said, {}
        return said

    def results(self) -> tuple[ShadowResult, ...]:
        """Results of shadows that have come in."""
        return tuple(result for shadow in self._shadows.values() for result in shadow.collect())

    def shadows(self) -> dict[str, ShadowView]:
        """The shadows by role."""
        return {role: shadow.view() for role, shadow in self._shadows.items()}

    def close(self) -> None:
        """End the shadows."""
        for shadow in self._shadows.values():
            shadow.close()

    def _start(self, plan: ShadowPlan) -> None:
        outputs = self._link.scenario.model.names("outputs")
        self._shadows[plan.role] = Shadow(self._link.path.absolute(), plan, outputs, self._make)

    def _tried(self) -> ShadowView | None:
        return self._shadows[TRIED].view() if TRIED in self._shadows else None

    def _switch(self, request: Request) -> str:
        if request.about not in MODES:
            return f"there is no position {request.about!r}"
        self.allowed = MODES[request.about]
        return f"the page's switch is at {request.about}"

    def _acknowledge(self, request: Request) -> str:
        self.alarms, words = acknowledged(self.alarms, request.about, request.person)
        return words

    def _try(self, request: Request) -> str:
        card, tried = self.card, self._tried()
        stages = (Stage.FOUND, Stage.REVERTED, *(() if tried is not None and tried.runs else (Stage.SHADOW,)))
        if card is None or not card.finding.effects or card.stage not in stages or self._reverts:
            return "there is nothing to try in shadow"
        if TRIED in self._shadows:
            self._shadows.pop(TRIED).close()
        file, finding = self._link.file, card.finding
        effects = (*self.use.cycle.effects, *finding.effects)
        played = None if finding.initial_state is None else self._inputs_since(finding.begin)
        history = None
        if played is not None and finding.initial_state is not None:
            history = (finding.initial_state, finding.begin, played)
        self._start(ShadowPlan(TRIED, file.estimator, file.controller, effects, finding.parameters, history))
        self.card = replace(card, stage=Stage.SHADOW, by=request.person)
        begun = self._shadows[TRIED].view()
        return "the extended model runs in shadow" if begun.runs else f"not tried: {begun.status}"

    def _apply(self, request: Request) -> str:
        card, tried = self.card, self._tried()
        if card is None or card.stage is not Stage.SHADOW or tried is None or not tried.runs or self._reverts:
            return "not applied: no extended model runs in shadow; try it in shadow first"
        if tried.compared.rows < FEWEST_ROWS:
            return f"not applied: it has run {tried.compared.rows} rows in shadow, {FEWEST_ROWS} are needed"
        self.card, self._applies = replace(card, stage=Stage.BUILDING, by=request.person), request.person
        self.use.build(card.finding.effects)
        return "the extended model is being built; it is taken up when it is ready"

    def _revert(self, request: Request) -> str:
        if self._applies:
            return "not reverted: an extended model is being built; ask again when it is taken up"
        if not self.use.extended:
            return "no extended model is in use"
        self._reverts = request.person
        return "the model before is in use again"

    def _own(self) -> list[Request]:
        """What the link asks for by itself, where its file lets it."""
        card, options = self.card, self._link.scenario.file.discovery
        if self._link.file.extend != "by itself" or card is None or options is None or not card.finding.effects:
            return []
        if card.stage is Stage.FOUND:
            return [Request(ITSELF, Action.SHADOW)]
        tried = self._tried()
        if card.stage is not Stage.SHADOW or tried is None or not tried.runs or tried.compared.worse:
            return []
        seen = tried.compared.rows * self._link.scenario.dt
        return [Request(ITSELF, Action.APPLY)] if seen >= options.delay_s else []
