"""The supervisor of a run, where its scenario asks for one; discovery and its libraries are imported only then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from adaptive_flot.contracts import AnyController, AnyEstimator
from adaptive_flot.greybox.model import Model
from adaptive_flot.runner.loop.loop import Running, Step
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.plants.fault_injection import with_controller_faults
from adaptive_flot.runner.scenario.realisation import Realisation

if TYPE_CHECKING:
    from adaptive_flot.runner.adaptation.inquiry import Inquiry


class Supervises(Protocol):
    """What `run_loop` calls after each interval, and what came of it."""

    @property
    def inquiries(self) -> Sequence[Inquiry] | None:
        """What came of each alarm; None where nothing is watched."""
        ...

    def __call__(self, running: Running, steps: list[Step]) -> Running:
        """The loop as it goes on."""
        ...


@dataclass(frozen=True)
class Unwatched:
    """Watches nothing and changes nothing."""

    inquiries: None = None

    def __call__(self, running: Running, steps: list[Step]) -> Running:
        """The loop as it is."""
        del steps
        return running


@contextmanager
def supervision(prepared: Prepared, estimator: str, controller: str, realisation: Realisation) -> Iterator[Supervises]:
    """Supervisor of a run; a search that is still at work when the run ends, in whatever way, ends with it."""
    options = prepared.scenario.file.discovery
    if options is None or estimator not in prepared.scenario.watched:
        yield Unwatched()
        return
    from adaptive_flot.runner.adaptation.supervisor import Supervisor

    def rebuild(model: Model) -> tuple[AnyEstimator, AnyController]:
        setup = replace(prepared.setup(estimator, realisation), model=model)
        made = prepared.controller(controller, realisation, setup)
        return prepared.new_estimator(estimator, setup), with_controller_faults(prepared.scenario, made)

    supervisor = Supervisor(options, rebuild)
    try:
        yield supervisor
    finally:
        supervisor.close()
