"""What the air flow has to do so that a measured change of the feed leaves the grade alone: dynamic feed-forward."""

from __future__ import annotations

import control
import numpy as np

from adaptive_flot.contracts import Sample
from adaptive_flot.greybox.linear import linearise
from adaptive_flot.greybox.model import FloatArray, Model


class FeedForward:
    """The inverse of the linearised cell from air to grade, driven by what is measured of the feed.

    With dx/dt = A x + B u + E d and grade = C x + D u + F d, all deviations from the operating point, the air flow
    u = -(C x + F d) / D keeps the grade: air acts on the froth at once, so D is not zero. What then drives the states,
    dx/dt = (A - B C / D) x + (E - B F / D) d, is stable wherever the grade answers air without an inverse response;
    where it is not (or D is zero), the feed-forward is static: the steady-state gain.

    Parameters
    ----------
    model
        The cell.
    inputs
        Operating point (nu,).
    dt
        Sampling interval [s].

    Raises
    ------
    RangeError
        There is no steady state at these inputs.
    """

    def __init__(self, model: Model, inputs: FloatArray, dt: float) -> None:
        self._feed = [i for i, q in enumerate(model.inputs) if q.name not in ("air_flow", "level_setpoint")]
        self._grades = [i for i, q in enumerate(model.parameters) if q.name.startswith("feed_concentration.")]
        self._inputs, self._parameters = inputs[self._feed].copy(), model.parameter_values[self._grades]
        cell = linearise(model, inputs, parameters_as_inputs=[model.parameters[i].name for i in self._grades])
        moved = [cell.input_labels[i] for i in (*self._feed, *range(len(model.inputs), cell.ninputs))]
        ahead = inverse(cell["concentrate_grade", "air_flow"], cell["concentrate_grade", moved])
        sampled = control.sample_system(ahead, dt, method="zoh")
        self.a, self.b, self.c, self.d = (np.asarray(m) for m in (sampled.A, sampled.B, sampled.C, sampled.D))

    def start(self) -> FloatArray:
        """State at the operating point."""
        return np.zeros(len(self.a))

    def step(self, state: FloatArray, sample: Sample) -> tuple[FloatArray, float]:
        """State one interval later, and the air flow asked for now, as a change from the operating point [m3/s].

        What is not finite counts as unchanged from the operating point; so does a feed grade that is not measured.
        """
        known = self._parameters if sample.parameters is None else sample.parameters[self._grades]
        changes = np.concatenate([sample.inputs[self._feed] - self._inputs, known - self._parameters])
        changes = np.where(np.isfinite(changes), changes, 0.0)
        return self.a @ state + self.b @ changes, float((self.c @ state + self.d @ changes)[0])


def inverse(air: control.StateSpace, feed: control.StateSpace) -> control.StateSpace:
    """The air that keeps the grade, from what happens to the feed; both of the same cell, with the same states."""
    a, b, c, d = (np.asarray(m) for m in (air.A, air.B, air.C, air.D))
    e, f = np.asarray(feed.B), np.asarray(feed.D)
    if d.item() != 0:
        dynamics = a - b @ c / d.item()
        if np.linalg.eigvals(dynamics).real.max() < 0:
            return control.ss(dynamics, e - b @ f / d.item(), -c / d.item(), -f / d.item())
    gains = -np.atleast_2d(control.dcgain(feed)) / float(np.real(control.dcgain(air)))
    return control.ss([], [], [], gains)
