"""A shadow seen from the link: started, fed, listened to, never waited for."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from adaptive_flot.contracts import Estimate, Prior
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.shadow.comparison import Compared, Comparison
from adaptive_flot.live.shadow.worker import Make, ShadowPlan, Task, make_stepper, work
from adaptive_flot.live.store.beside import ShadowResult

MOST_BEHIND = 5
"""Samples that a shadow may still work at; those that come meanwhile are left out. A pipe holds many more."""
ENDED = "ended"


@dataclass(frozen=True)
class ShadowView:
    """What is known of a shadow after a cycle.

    Attributes
    ----------
    plan
        What runs.
    status
        In words; `ended: ...` where it does not run any more.
    left_out
        Samples that it was not given, because it was still at work.
    newest
        Its newest result; None before the first.
    compared
        Its errors beside those of the acting estimator.
    """

    plan: ShadowPlan
    status: str
    left_out: int
    newest: ShadowResult | None
    compared: Compared

    @property
    def runs(self) -> bool:
        """It has not ended."""
        return not self.status.startswith(ENDED)


class Shadow:
    """One process in shadow.

    Parameters
    ----------
    link_file
        The link file, absolute.
    plan
        What runs.
    outputs
        Names of the model's outputs.
    make
        Makes what steps, in the process.
    """

    def __init__(self, link_file: Path, plan: ShadowPlan, outputs: Sequence[str], make: Make = make_stepper) -> None:
        self.plan = plan
        self._comparison = Comparison(outputs)
        self._built = False
        self._behind = 0
        self._left_out = 0
        self._status = "is being built"
        self._newest: ShadowResult | None = None
        self._connection: Connection | None = None
        self._process: BaseProcess | None = None
        try:
            self._start(link_file, make)
        except OSError as error:  # no process or no handle is left: the link goes on without this one
            self._status = f"{ENDED}: can not be started ({error.strerror or error})"

    def _start(self, link_file: Path, make: Make) -> None:
        context = multiprocessing.get_context("spawn")  # the link has threads, which no fork may copy
        self._connection, other = context.Pipe()
        process = context.Process(
            target=work, args=(other, link_file, self.plan, make), name=f"shadow {self.plan.role}", daemon=True
        )
        try:
            process.start()
            self._process = process
        finally:
            other.close()

    def feed(self, task: Task, acting: Estimate) -> None:
        """Give a sample, unless it is not built yet or too many wait."""
        if self._connection is None or self._status.startswith(ENDED) or not self._built:
            return
        self._comparison.acting(task.cycle, acting)
        if self._behind >= MOST_BEHIND:
            self._left_out += 1
            return
        try:
            self._connection.send(task)
        except OSError:  # it has ended: `collect` reads its last words
            return
        self._behind += 1

    def collect(self) -> list[ShadowResult]:
        """Results that have come in since; never waits."""
        found: list[ShadowResult] = []
        if self._connection is None or self._status.startswith(ENDED):
            return found
        try:
            while self._connection.poll(0):
                told = self._connection.recv()
                if told is None:
                    self._built = True
                    continue
                if isinstance(told, str):
                    self._end(told)
                    break
                self._behind -= 1
                self._comparison.shadow(told)
                self._newest, self._status = told, told.status
                found.append(told)
        except (EOFError, OSError):
            self._end("")
        if self._status.startswith(ENDED) and self._newest is not None and self._newest.status != self._status:
            self._newest = ShadowResult(self._newest.cycle + 1, self.plan.role, self._status, math.nan)
            found.append(self._newest)
        return found

    def view(self) -> ShadowView:
        """What is known of it now."""
        slow = f"; slow: {self._behind} samples behind" if self._behind >= MOST_BEHIND else ""
        status = self._status if self._status.startswith(ENDED) else f"{self._status}{slow}"
        return ShadowView(self.plan, status, self._left_out, self._newest, self._comparison.compared())

    def close(self) -> None:
        """End it."""
        if self._connection is not None:
            self._connection.close()
        if self._process is not None:
            self._process.kill()
            self._process.join()

    def _end(self, words: str) -> None:
        assert self._process is not None
        self._process.join(0.05)
        code = self._process.exitcode
        self._status = f"{ENDED}: {words or f'its process ended with {code}'}"


def task_of(outcome: Outcome, began: Prior, inputs: Sequence[str]) -> Task:
    """The task of a cycle that has a sample and an estimate; `inputs` are the names of the model's inputs.

    `began` is what the acting estimator was started with.
    """
    sample, e = outcome.sample, outcome.estimate
    assert sample is not None and e is not None
    acting = sample.inputs.copy()
    for name, value in outcome.acting.items():
        if math.isfinite(value):
            acting[inputs.index(name)] = value
    return Task(outcome.number, sample, acting, began.at(e))
