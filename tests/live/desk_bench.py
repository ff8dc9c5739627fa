"""A desk beside a link and its plant in lockstep, in one process: what `LinkRun` does, without the network."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from adaptive_flot.contracts import Estimate
from adaptive_flot.live.finding import Finding
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.plant.direct import DirectPlant
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.requests import Action, Answered, Request
from adaptive_flot.live.running.desk import Desk
from adaptive_flot.live.running.model_use import ModelUse
from adaptive_flot.live.running.progress import Progress
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.shadow.worker import Make, make_stepper
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store.beside import Beside
from adaptive_flot.live.store.memory import Memory
from adaptive_flot.runner.scenario.realisation import Realisation
from tests.live.bench import INITIAL


class DeskBench:
    """Link, plant and desk; what `memory` is given, it stores."""

    def __init__(self, link: Link, make: Make = make_stepper, memory: Memory | None = None) -> None:
        self.link, self.memory = link, memory
        resumed = None if memory is None else memory.resumed
        self.use = ModelUse(link, () if resumed is None else resumed.extensions)
        self.desk = Desk(link, self.use, make, allowed=Mode.CLOSED if memory is None else memory.allowed)
        self.direct = DirectPlant(TestPlant(Realisation(link.scenario, 1)))
        self.state = self.use.cycle.start(None if resumed is None else resumed.prior)
        self.finding: Finding | None = None
        self.well = True
        self.conditions: Callable[[], dict[str, str]] = dict

    def interval(self, requests: Sequence[Request] = (), changed: Snapshot | None = None) -> Progress:
        """One interval, with what persons ask for before it."""
        self.direct.interval()
        answered: tuple[Answered, ...] = self.desk.answer(requests)
        self.state, change = self.desk.change_model(self.state)
        told = changed or self.direct.snapshot(written=self.well)
        snapshot = Snapshot(**{**vars(told), "allowed": self.desk.allowed})
        self.state, outcome = self.use.cycle.step(self.state, snapshot)
        began = self.state.estimation.began
        self.desk.after(outcome, began, self.finding, self.conditions())
        beside = Beside(answered, self.desk.said(), self.desk.results(), change)
        if self.memory is not None:
            self.memory.store(snapshot, outcome, began, {}, beside=beside)
        results = self.direct.take(outcome)
        self.well = not any(w.problem for w in results.values())
        desk, state = self.desk, self.state
        shown = desk.alarms, desk.card, desk.shadows(), answered, self.use.extended
        model = self.use.cycle.model
        return Progress(snapshot, outcome, 0.004, "", True, state.modes, state.histories, model, *shown)

    def ask(self, action: Action, about: str = "", person: str = "A. Person") -> str:
        """One interval with a request; what came of it."""
        progress = self.interval([Request(person, action, about, "2026-01-01T00:00:00+00:00")])
        return progress.answered[0].answer

    def run(self, intervals: int) -> list[Outcome]:
        """So many intervals."""
        return [self.interval().outcome for _ in range(intervals)]

    def to_closed(self) -> None:
        """Past the initial estimate, and the operator at the plant lets the link go to closed."""
        self.run(INITIAL + 3)
        self.direct.operate("switch", Mode.CLOSED)
        assert self.run(4)[-1].mode is Mode.CLOSED

    @property
    def estimate(self) -> Estimate:
        """The newest estimate."""
        found = self.state.estimation.estimate
        assert found is not None
        return found
