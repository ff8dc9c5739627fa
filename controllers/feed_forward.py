"""What an input has to do so that a measured disturbance leaves an output alone: dynamic feed-forward."""

from __future__ import annotations

import control
import numpy as np

from adaptive_flot.contracts import ControllerSetup, Sample
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.linear import linearise


class FeedForward:
    """The inverse of the linearised process from one input to one output, driven by the measured disturbances.

    With dx/dt = A x + B u + E d and y = C x + D u + F d, all deviations from the last planned inputs, the input
    u = -(C x + F d) / D keeps the output y. What then drives the states, dx/dt = (A - B C / D) x + (E - B F / D) d, is
    stable wherever y answers u without an inverse response. Where it is not, or D is zero, the feed-forward is static:
    the steady-state gain. In a flotation cell air acts on the froth at once, so D is not zero.

    Disturbances are the inputs without a range in the limits, and the parameters that are disturbances.

    Parameters
    ----------
    setup
        Model, sampling interval, schedule and limits.
    pair
        Names of the input that is moved and of the output that it keeps.

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """

    def __init__(self, setup: ControllerSetup, pair: tuple[str, str]) -> None:
        model, inputs = setup.model, setup.schedule[-1]
        moved, output = pair
        self._of_inputs, self._of_parameters = disturbances(setup)
        self._inputs, self._parameters = inputs[self._of_inputs].copy(), model.parameter_values[self._of_parameters]
        names = [model.parameters[i].name for i in self._of_parameters]
        process = linearise(model, inputs, parameters_as_inputs=names)
        disturbing = [process.input_labels[i] for i in (*self._of_inputs, *range(len(model.inputs), process.ninputs))]
        ahead = inverse(process[output, moved], process[output, disturbing])
        sampled = control.sample_system(ahead, setup.dt, method="zoh")
        self.a, self.b, self.c, self.d = (np.asarray(m) for m in (sampled.A, sampled.B, sampled.C, sampled.D))

    def start(self) -> FloatArray:
        """State at the operating point."""
        return np.zeros(len(self.a))

    def step(self, state: FloatArray, sample: Sample) -> tuple[FloatArray, float]:
        """State one interval later, and the change of the input asked for now, from the operating point, in its unit.

        What is not finite counts as unchanged from the operating point; so does a parameter that is not measured.
        """
        known = self._parameters if sample.parameters is None else sample.parameters[self._of_parameters]
        changes = np.concatenate([sample.inputs[self._of_inputs] - self._inputs, known - self._parameters])
        changes = np.where(np.isfinite(changes), changes, 0.0)
        return self.a @ state + self.b @ changes, float((self.c @ state + self.d @ changes)[0])


def disturbances(setup: ControllerSetup) -> tuple[list[int], list[int]]:
    """Indices of the inputs without a range in the limits, and of the parameters that are disturbances."""
    ranged = () if setup.limits is None else setup.limits.inputs
    of_inputs = [i for i, q in enumerate(setup.model.inputs) if q.name not in ranged]
    return of_inputs, [i for i, p in enumerate(setup.model.parameters) if p.disturbance]


def has_disturbances(setup: ControllerSetup) -> bool:
    """Whether there is anything to feed forward."""
    return any(disturbances(setup))


def inverse(moved: control.StateSpace, disturbing: control.StateSpace) -> control.StateSpace:
    """From disturbances to the input that keeps the output, from the responses of the output to each.

    Both are of the same process, with the same states.
    """
    a, b, c, d = (np.asarray(m) for m in (moved.A, moved.B, moved.C, moved.D))
    e, f = np.asarray(disturbing.B), np.asarray(disturbing.D)
    if d.item() != 0:
        dynamics = a - b @ c / d.item()
        if np.linalg.eigvals(dynamics).real.max() < 0:
            return control.ss(dynamics, e - b @ f / d.item(), -c / d.item(), -f / d.item())
    gains = -np.atleast_2d(control.dcgain(disturbing)) / float(np.real(control.dcgain(moved)))
    return control.ss([], [], [], gains)
