"""The contract of a controller: what it is built for, what it decides and what it expects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeGuard, TypeVar, runtime_checkable

from adaptive_flot.contracts.economics import Economics
from adaptive_flot.contracts.estimator import Estimate
from adaptive_flot.contracts.sample import Sample
from adaptive_flot.contracts.status import Status
from adaptive_flot.greybox.model import FloatArray, Model

State = TypeVar("State")


@dataclass(frozen=True)
class Plan:
    """What a controller expects of the moves it looked ahead, H of them.

    Attributes
    ----------
    time
        End of each move [s] (H,).
    inputs
        Each moved input by name, in its unit: its value held during the move that ends at `time` (H,).
    outputs
        Each limited output by name, in its unit: its value expected at `time` (H,), with the controller's correction
        of the model.
    """

    time: FloatArray
    inputs: Mapping[str, FloatArray]
    outputs: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Decision:
    """Info record of one controller step.

    Attributes
    ----------
    inputs
        Inputs (nu,) to hold until the next decision.
    status
        What happened.
    decided_by
        Who took it: a controller, or the fallback that stepped in.
    solve_seconds
        Wall-clock time of the optimisation; NaN where none ran.
    message
        What was wrong, in words: the most violated constraints of a failed solve, or the limits that were given up.
    plan
        What the optimisation that this decision comes from expects; None where none ran or none was valid.
    faults
        Names of the faults that were injected into this decision.
    softened
        How far beyond a limit the plan goes at most, by name of the output, state or input, in its unit: what was given
        up where no plan keeps every limit.
    """

    inputs: FloatArray
    status: Status
    decided_by: str
    solve_seconds: float = float("nan")
    message: str = ""
    plan: Plan | None = None
    faults: tuple[str, ...] = ()
    softened: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Limits:
    """Where a process may be run.

    The ranges of outputs and states can be left when a disturbance is too large, those of inputs can not. A move is
    larger than the largest one only where it brings an input back into its range.

    Attributes
    ----------
    outputs
        Range of each limited output by name, in its unit; an infinite end is no limit. A product's quality, say.
    inputs
        Range of each moved input by name, in its unit; the other inputs are disturbances.
    moves
        Largest move of each of them from one control move to the next.
    states
        Range of each limited state by name, in its unit.
    """

    outputs: Mapping[str, tuple[float, float]]
    inputs: Mapping[str, tuple[float, float]]
    moves: Mapping[str, float]
    states: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class ControllerSetup:
    """What a controller is built for.

    Attributes
    ----------
    model
        The grey-box model.
    dt
        Sampling interval [s].
    schedule
        Planned inputs (N, nu): what an open-loop run plays, and where a closed loop starts. What a closed loop does not
        move is a disturbance: the plan holds its first value, and `Sample.inputs` what is known of it later.
    parameters
        Names of the adapted parameters, in the order of `Estimate.parameters`.
    limits, economics
        For controllers that need them; an open loop has none.
    """

    model: Model
    dt: float
    schedule: FloatArray
    parameters: tuple[str, ...] = ()
    limits: Limits | None = None
    economics: Economics | None = None


class Controller(Protocol[State]):
    """Chooses the inputs of the next interval. Made by `Name(setup, **options)`.

    One that uses neither sample nor estimate may say `open_loop = True` in its class; it is not inherited. Runs of many
    seeds may then go side by side, and both are None at every decision. One that also has `decide_all` is not called
    for each of them (see `DecidesAll`).
    """

    def init(self, time: float) -> State:
        """State before the first decision, at a time [s]."""
        ...

    def decide(self, state: State, sample: Sample | None, estimate: Estimate | None) -> tuple[State, Decision]:
        """Inputs for the next interval, from the newest sample and estimate (None before the first)."""
        ...


@dataclass(frozen=True)
class DecisionTable:
    """Decisions of N intervals that nothing solved and nobody changed.

    Attributes
    ----------
    inputs
        Inputs (N, nu).
    status, decided_by
        Of every one; see `Decision`.
    """

    inputs: FloatArray
    status: Status
    decided_by: str


class DecidesAll(Protocol):
    """An open loop that gives all its decisions at once."""

    def decide_all(self, intervals: int) -> DecisionTable:
        """What `init` at 0 s and then `decide` give for so many intervals."""
        ...


def decides_all(controller: object) -> TypeGuard[DecidesAll]:
    """Whether `decide_all` is what `decide` gives: not where a derived class has its own `decide`."""
    first = {
        name: next((c for c in type(controller).__mro__ if name in vars(c)), None) for name in ("decide", "decide_all")
    }
    return first["decide_all"] is not None and first["decide"] is first["decide_all"]


@runtime_checkable
class TakesOver(Protocol):
    """A controller whose state depends on its model, and that can go on where one with a smaller model stood.

    The model of a running loop may be extended (`Model.with_effects`): states and parameters are added behind those in
    common. A controller without this method gets the state of the one before as it is.
    """

    def take_over(self, before: AnyController, state: Any, known: Sequence[Estimate], again: Sequence[Estimate]) -> Any:
        """State of this controller that goes on from a state of the one before.

        Parameters
        ----------
        before, state
            A controller of the same class and options for the smaller model, and its state.
        known
            The last estimates that it was told, oldest first.
        again
            What an estimator with this controller's model makes of the same samples.
        """
        ...


@runtime_checkable
class TracksInputs(Protocol):
    """A controller that can be told what really acts, while somebody else sets the inputs or a limit cuts its own.

    Its next decision starts from there, without a bump. A controller without this method decides from its own state;
    whoever writes its decisions then limits their rate alone.
    """

    def tracked(self, state: Any, inputs: FloatArray) -> Any:
        """State as if these inputs (nu,) had been the last decision."""
        ...


AnyController = Controller[Any]
