"""What the plant's outputs do that the model's do not, as a level and a slope: modifier adaptation.

A bias corrects where an output is, not how it answers to an input. Where limits alone say where to go, that is enough.
Where the best point lies inside the limits, the model's slopes say where it is. Modifier adaptation adds what the
slopes are off by (Marchetti, Chachuat & Bonvin, Industrial & Engineering Chemistry Research 48 (2009) 6022, eq. 6;
within an economic MPC: Vaccari & Pannocchia, Processes 5 (2017) 2):

    y(u) = y_model(u) + b + M (u - u_b).

A point at which the loop rests with right b and M fulfils the first-order conditions of the plant. Both are learnt from
measured outputs, and both enter limits and economics. A slope is learnt from moves that are made anyway. Each `every`
the model is set out on a run with what is believed then; it gets the inputs that come. How far its outputs are off
after `settling_s`, against how far the inputs went, is one pair of the regression (`slopes.py`).

u_b is the input that the bias answers to: filtered, since the plant needs time to answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adaptive_flot.contracts import ControllerSetup, Estimate, Sample, full_parameters
from adaptive_flot.errors import ModelError, near_match
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.stepper import Stepper
from controllers.economic_mpc.modifiers.slopes import SlopeSums
from controllers.economic_mpc.output_bias import OutputBias
from controllers.economic_mpc.problem.layout import StageLayout

NUMBERS = ("settling_s", "memory_s", "prior")
"""Options that are positive numbers."""
ANSWERED = 3
"""A settling time is three time constants: 95 % of an answer."""
BIASES_KNOWN = 5
"""Time constants of the filters of biases before the first run: what they still have to learn is no slope."""
TRIED = 1e-3
"""Change of an input that tells how the model answers, over its range."""
LEAST_ANSWER = 0.1
"""Answer over the range of an input below which a share of it says nothing, in the scale of the output."""


@dataclass(frozen=True)
class Start:
    """What was believed when a run of the model began.

    Attributes
    ----------
    row
        Samples heard until then.
    time
        [s].
    state, parameters
        Of the model (nx,), (np,).
    biases, answered
        As in `ModifierState`.
    """

    row: int
    time: float
    state: FloatArray
    parameters: FloatArray
    biases: FloatArray
    answered: FloatArray


@dataclass(frozen=True)
class ModifierState:
    """What is known, and runs of the model that have not come to their end.

    Attributes
    ----------
    row
        Samples heard so far.
    biases, heard
        Filtered measured minus predicted value of each output, and time of the newest value in it [s] (ny,).
    answered
        Moved inputs that the biases answer to (m,); NaN before the first sample.
    starts
        Runs of the model, the oldest first.
    inputs
        Inputs (nu,) of each interval since the oldest of them.
    sums
        Of the regression.
    answers
        How the model's outputs answer to the inputs after the settling time (ny, m), scaled.
    """

    row: int
    biases: FloatArray
    heard: FloatArray
    answered: FloatArray
    starts: tuple[Start, ...]
    inputs: tuple[FloatArray, ...]
    sums: SlopeSums
    answers: FloatArray

    def without_runs(self) -> ModifierState:
        """The same knowledge; runs of the model begin anew."""
        return replace(self, starts=(), inputs=())


def answer_time(settling_s: float) -> float:
    """Time constant [s] with which outputs answer."""
    return settling_s / ANSWERED


def modifier_options(asked: bool | Mapping[str, Any], horizon_s: float) -> dict[str, Any] | None:
    """Options of `Modifiers` with their settling time, by default the horizon [s]; None for no modifiers.

    Raises
    ------
    ModelError
        It is neither a truth value nor a mapping, an option is not known, or has no value that it may have.
    """
    if asked is False:
        return None
    if asked is not True and not isinstance(asked, Mapping):
        raise ModelError(f"economic_mpc: modifiers = {asked!r}; give true, false or options")
    options = {"settling_s": horizon_s} | ({} if asked is True else dict(asked))
    for name, value in options.items():
        if name not in (*NUMBERS, "outputs"):
            raise ModelError(f"modifiers: {name!r} is no option; {near_match(str(name), (*NUMBERS, 'outputs'))}")
        if name in NUMBERS and not (isinstance(value, int | float) and np.isfinite(value) and value > 0):
            raise ModelError(f"modifiers: {name} = {value!r}; give a positive number")
        if name == "outputs" and (isinstance(value, str) or not isinstance(value, Sequence)):
            raise ModelError(f"modifiers: outputs = {value!r}; give a list of names")
    return options


class Modifiers:
    """Learns biases and slopes of the measured outputs.

    Parameters
    ----------
    setup, layout
        Of the controller.
    bias_time_s
        Time constant of the filters of biases [s].
    settling_s
        Time after which an input has had its effect [s], at least the length of a move.
    memory_s
        Time constant of forgetting [s].
    prior
        Standard deviation expected of an error of a slope, as a share of the model's slope. Where that is nearly zero:
        of the scale of the output over the range of the input.
    outputs
        Names of the outputs that are corrected, of those that are measured; default all.

    Raises
    ------
    ModelError
        An option outside its range.
    """

    def __init__(
        self,
        setup: ControllerSetup,
        layout: StageLayout,
        bias_time_s: float,
        *,
        settling_s: float,
        memory_s: float = 7200.0,
        prior: float = 0.5,
        outputs: Sequence[str] | None = None,
    ) -> None:
        if settling_s < layout.move_s:
            raise ModelError(f"modifiers: settling_s = {settling_s:g}; give at least move_s = {layout.move_s:g} s")
        model = setup.model
        names = model.names("outputs")
        for name in outputs or ():
            if name not in names:
                raise ModelError(f"modifiers: {name!r} is no output of the model; {near_match(name, names)}")
        self.setup, self.layout = setup, layout
        self.every, self.run = (max(round(t / setup.dt), 1) for t in (layout.move_s, settling_s))
        self.corrected = np.array([outputs is None or name in outputs for name in names])
        self._biases = [OutputBias(name, i, setup.dt, bias_time_s) for i, name in enumerate(names)]
        self._first = round(BIASES_KNOWN * bias_time_s / setup.dt)
        self._kept = float(np.exp(-setup.dt / answer_time(settling_s)))
        self._weight = self.every / self.run  # runs overlap: they count for as many as follow each other
        self._memory = float(np.exp(-self.every * setup.dt / memory_s))
        low, high = np.array([layout.limits.inputs[name] for name in layout.moved_names]).T
        self._span, self._scale = high - low, np.array([q.scale for q in model.outputs])
        self._prior = prior
        self._stepper = Stepper(model, setup.dt)

    def init(self, time: float) -> ModifierState:
        """Nothing is known at a time [s]."""
        ny, m = len(self._biases), self.layout.inputs_size
        return ModifierState(
            0, np.zeros(ny), np.full(ny, time), np.full(m, np.nan), (), (), SlopeSums.none(ny, m), np.zeros((ny, m))
        )

    def heard(self, state: ModifierState, sample: Sample | None, estimate: Estimate | None) -> ModifierState:
        """One sample later; runs of the model end where one is missing."""
        if sample is None or estimate is None:
            return state.without_runs()
        filters = zip(self._biases, state.biases, state.heard, strict=True)
        biases, heard = np.array([own.after(bias, at, estimate) for own, bias, at in filters]).T
        moved = sample.inputs[self.layout.moved]
        answered = self._kept * state.answered + (1 - self._kept) * moved
        answered = np.where(np.isfinite(answered), answered, moved)
        inputs = (*state.inputs, sample.inputs.copy()) if state.starts else ()
        state = replace(state, row=state.row + 1, biases=biases, heard=heard, answered=answered, inputs=inputs)
        if state.starts and state.row - state.starts[0].row >= self.run:
            state = self._ended(state, estimate)
        due = state.row - state.starts[-1].row >= self.every if state.starts else state.row >= self._first
        if due:
            theta = full_parameters(self.setup.model, self.setup.parameters, estimate.parameters, sample.parameters)
            begun = Start(state.row, estimate.time, estimate.state, theta, biases, answered)
            state = replace(state, starts=(*state.starts, begun))
        return state

    def slopes(self, state: ModifierState) -> FloatArray:
        """Slopes (ny, m), each in the unit of its output over that of its input; zero where nothing was measured."""
        expected = self._prior * np.maximum(np.abs(state.answers), LEAST_ANSWER)
        found = state.sums.slopes(expected) * self._scale[:, None] / self._span
        return np.where(self.corrected[:, None], found, 0.0)

    def offsets(self, state: ModifierState) -> FloatArray:
        """Biases (ny,), each in the unit of its output; zero where nothing was measured."""
        return np.where(self.corrected, state.biases, 0.0)

    def taken_over(self, state: ModifierState, known: Sequence[Estimate], again: Sequence[Estimate]) -> ModifierState:
        """Go on with another model; see `TakesOver.take_over`. Its slopes are learnt anew."""
        changes = [own.change(known, again) for own in self._biases]
        sums = SlopeSums.none(len(self._biases), self.layout.inputs_size)
        return replace(state.without_runs(), biases=state.biases + np.array(changes), sums=sums)

    def _ended(self, state: ModifierState, estimate: Estimate) -> ModifierState:
        """Compare the oldest run with what came, and forget it."""
        first, later = state.starts[0], state.starts[1:]
        used = state.row - first.row
        inputs = np.array(state.inputs[:used])
        end = self._end(first, inputs)
        filters = zip(self._biases, state.biases, strict=True)
        came = np.array([own.corrected(estimate, bias) for own, bias in filters])
        # of an output that nobody measures the bias is zero for ever: what "came" is what the model says
        measured = state.heard > first.time
        error = np.where(measured, came - end - first.biases, np.nan) / self._scale
        change = (state.answered - first.answered) / self._span
        sums = state.sums.after(change, error, self._weight, self._memory)
        begin = later[0].row - first.row if later else used
        answers = np.column_stack([self._end(first, inputs, j) - end for j in range(len(self._span))]) / TRIED
        answers = np.where(np.isfinite(answers), answers, 0.0) / self._scale[:, None]
        return replace(state, starts=later, inputs=state.inputs[begin:], sums=sums, answers=answers)

    def _end(self, first: Start, inputs: FloatArray, moved: int | None = None) -> FloatArray:
        """Outputs (ny,) at the end of a run, one of the moved inputs a little larger all the time."""
        if moved is not None:
            inputs = inputs.copy()
            inputs[:, self.layout.moved[moved]] += TRIED * self._span[moved]
        run = self._stepper.simulate(first.state, inputs, first.parameters, first.time)
        end: FloatArray = run.outputs[-1]
        return end
