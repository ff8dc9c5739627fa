"""The three contracts: Plant, Estimator, Controller. Plug-ins import nothing but this file and the engine.

State in, state out. An estimator or a controller is a frozen configuration plus compiled functions, ready when its
constructor returns; what changes from sample to sample is a frozen dataclass that is passed in and handed back. So a
run can be replayed, resumed from any step and compared to the bit. What the next step needs is *state*; what a plot or
a test needs is the *info* record (`Estimate`, `Decision`).

Time convention: the inputs of a sample are those held during the interval that ends at its time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol, TypeVar, runtime_checkable

from adaptive_flot.economics import Prices
from adaptive_flot.greybox.model import FloatArray, Model

State = TypeVar("State")


class Status(Enum):
    """What happened at one step. Numbers fail as values: none of these is an exception."""

    OK = "ok"
    MISSING = "measurement missing: predicted only"
    LATE = "late value put in its place, the samples since then taken again"
    TOO_OLD = "late value without a sample of its time among those kept: not used"
    PROJECTED = "estimate projected onto its bounds"
    LOW_INFORMATION = "the data say too little about some direction: the estimate is held along it"
    NOT_FINITE = "prediction not finite: sample skipped, last estimate kept"
    NOT_CONVERGED = "search stopped before it converged: best values so far"
    RETRIED = "solved at the second try, from a cold start"
    SHIFTED_PLAN = "no valid solution: the plan of the step before goes on"
    HELD = "no valid solution and no plan: the inputs are held"
    SAFE_INPUT = "nothing else was valid: the safe inputs"
    INITIALISING = "collecting the record for the initial estimate"


@dataclass(frozen=True)
class LateValue:
    """A measurement that arrives after its time: output by name, time it was taken [s], value in the output's unit."""

    output: str
    time: float
    value: float


@dataclass(frozen=True)
class Sample:
    """What the instruments show at one sampling instant.

    Outputs may be measured at different rates: at any instant some are NaN, and only the others correct the estimate.

    Attributes
    ----------
    time
        Time [s].
    inputs
        Inputs held during the interval until then (nu,), as far as they are known: commands, and disturbances as they
        are measured or assumed.
    outputs
        Outputs measured at this time (ny,), NaN where there is no measurement.
    late
        Values that arrive with this sample and were taken earlier (a laboratory assay, an analyser with dead time).
    parameters
        Parameter vector (np,): the nominal one with what is measured in it (the feed grade); None where nothing is.
    """

    time: float
    inputs: FloatArray
    outputs: FloatArray
    late: tuple[LateValue, ...] = ()
    parameters: FloatArray | None = None


@dataclass(frozen=True)
class Setup:
    """What an estimator is built for.

    Attributes
    ----------
    model
        The grey-box model; its parameter values are the nominal ones.
    dt
        Sampling interval [s].
    parameters
        Names of the q adapted parameters.
    outputs
        Names of the measured outputs that drive the adaptation.
    truth
        True parameters (N, np), row k for the interval that starts at k dt: for the oracle only, None for all others.
    """

    model: Model
    dt: float
    parameters: tuple[str, ...] = ("growth_exponent", "coalescence_rate")
    outputs: tuple[str, ...] = ("concentrate_grade",)
    truth: FloatArray | None = None


@dataclass(frozen=True)
class Prior:
    """Where an estimator starts.

    Attributes
    ----------
    time
        Time of the state [s].
    state
        Model state (nx,).
    parameters
        Adapted parameters (q,), each in its unit.
    covariance
        Their covariance (q, q).
    noise_std
        Standard deviation of the measurement noise of each driving output (m,).
    joint_covariance
        Covariance of state and parameters together (nx + q, nx + q); None: the state is taken as known.
    """

    time: float
    state: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    noise_std: FloatArray
    joint_covariance: FloatArray | None = None


@dataclass(frozen=True)
class Estimate:
    """Info record of one estimator step.

    Attributes
    ----------
    time
        Time of the sample [s].
    prediction
        All outputs (ny,) predicted from the previous sample, before this one was used.
    innovation
        Measured minus predicted (ny,), NaN where missing.
    innovation_std
        Standard deviation the estimator expects of the innovation of each driving output (m,).
    parameters
        Adapted parameters after the sample (q,).
    covariance
        Their covariance (q, q), symmetric and positive semi-definite.
    state
        Model state (nx,) at the time of the sample.
    status
        What happened.
    late
        Innovations of the late values that were used: output, time taken, measured minus predicted then.
    """

    time: float
    prediction: FloatArray
    innovation: FloatArray
    innovation_std: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    state: FloatArray
    status: Status
    late: tuple[LateValue, ...] = ()


class Estimator(Protocol[State]):
    """Tracks parameters (and the state) from one sample to the next.

    Made by `Name(setup, **options)`. `setup` is kept as an attribute; nothing else may change after construction.

    Late values: after one, the estimate is what the same value in time would have given. An estimator need not see to
    that: `adaptive_flot.late.LateValues`, put around it by the loop wherever a measurement has a dead time, does. One
    that keeps a window of samples anyway may take `Sample.late` itself; it then has `takes_late_values = True`.

    Whole records: an estimator may have `track(state, time, inputs, outputs) -> Track` (`adaptive_flot/track.py`) that
    gives for N samples what N calls of `update` give; replays of measured records then use it.
    """

    setup: Setup

    def init(self, prior: Prior) -> State:
        """State before the first sample."""
        ...

    def update(self, state: State, sample: Sample) -> tuple[State, Estimate]:
        """Take one sample, one interval after the last.

        Missing outputs are NaN; a sample in which all driving outputs are missing gives a status, not an error.

        Raises
        ------
        ModelError
            A vector of the wrong length.
        """
        ...


@dataclass(frozen=True)
class Plan:
    """What a controller expects of the moves it looked ahead, H of them.

    Attributes
    ----------
    time
        End of each move [s] (H,).
    inputs
        Each moved input by name, in its unit: its value held during the move that ends at `time` (H,).
    grade
        Concentrate grade expected at `time` [-] (H,), with the controller's correction of the model.
    """

    time: FloatArray
    inputs: Mapping[str, FloatArray]
    grade: FloatArray


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
        What was wrong, in words: the most violated constraints of a failed solve.
    plan
        What the optimisation that this decision comes from expects; None where none ran or none was valid.
    faults
        Names of the faults that were injected into this decision.
    """

    inputs: FloatArray
    status: Status
    decided_by: str
    solve_seconds: float = float("nan")
    message: str = ""
    plan: Plan | None = None
    faults: tuple[str, ...] = ()


@dataclass(frozen=True)
class Limits:
    """Where a cell may be run.

    Attributes
    ----------
    grade
        Lowest concentrate grade allowed [-].
    level
        Range of the pulp height [m] (2,).
    inputs
        Range of each moved input by name, in its unit.
    moves
        Largest move of each of them from one control move to the next.
    """

    grade: float
    level: tuple[float, float]
    inputs: Mapping[str, tuple[float, float]]
    moves: Mapping[str, float]


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
    limits, prices
        For controllers that need them; a scenario without economics has none.
    """

    model: Model
    dt: float
    schedule: FloatArray
    parameters: tuple[str, ...] = ()
    limits: Limits | None = None
    prices: Prices | None = None


class Controller(Protocol[State]):
    """Chooses the inputs of the next interval. Made by `Name(setup, **options)`."""

    def init(self, time: float) -> State:
        """State before the first decision, at a time [s]."""
        ...

    def decide(self, state: State, sample: Sample | None, estimate: Estimate | None) -> tuple[State, Decision]:
        """Inputs for the next interval, from the newest sample and estimate (None before the first)."""
        ...


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


@dataclass(frozen=True)
class PlantRecord:
    """What a plant shows after one interval.

    Attributes
    ----------
    sample
        What is measured.
    outputs
        True outputs (ny,), without what effects on sensors add; NaN in a replayed record.
    parameters
        True parameter vector (np,) during the interval, NaN in a replayed record.
    inputs
        Inputs (nu,) that really acted; `sample.inputs` is what is known of them.
    faults
        Names of the injected faults that changed something in the interval.
    """

    sample: Sample
    outputs: FloatArray
    parameters: FloatArray
    inputs: FloatArray
    faults: tuple[str, ...] = ()


class Plant(Protocol[State]):
    """The process: simulated, or a replayed record."""

    def init(self) -> State:
        """State at the start."""
        ...

    def apply(self, state: State, inputs: FloatArray) -> tuple[State, PlantRecord]:
        """Hold the inputs (nu,) for one interval; disturbances among them are the plant's own."""
        ...


AnyEstimator = Estimator[Any]
AnyController = Controller[Any]
AnyPlant = Plant[Any]


def full_parameters(
    model: Model, names: Sequence[str], values: FloatArray, known: FloatArray | None = None
) -> FloatArray:
    """Parameter vector (np,) with some entries replaced: of `known` (`Sample.parameters`), else of the model."""
    p = model.parameter_values if known is None else known.copy()
    p[model.indices("parameters", names)] = values
    return p
