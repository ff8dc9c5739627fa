"""How the innovations of a filter answer to what happens at a site.

With the filter's gain K, its transition F = df/dz and H = dh/dz at every row, a change a_k of the value at a site in
the interval that leads to row k + 1 moves the innovations by::

    e_(k+1) = -H_k d_k - h_k a_k          d_(k+1) = F_k (d_k + K_k e_(k+1)) + b_k a_k

where b and h are the derivatives of the next state and of the outputs by the site's value. So what an effect does to
the record is a linear function of its course, and every family of effects is a regression. Willsky & Jones, *IEEE
Trans. Automatic Control* 21 (1976) 108, on jumps; Basseville & Nikiforov, *Detection of Abrupt Changes* (1993), 7.2.4.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.hypotheses.joint.rows import BoolArray, noise_floor
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.filtering import Filtered, NoiseModel, RecordFilter
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.in_steps import interval_by_interval, jacobians_at_the_end, steps_along
from adaptive_flot.greybox.stepping.linear_run import linear_run
from adaptive_flot.greybox.stepping.recursion import RowByRow
from adaptive_flot.greybox.stepping.stepper import Stepper

CLIP = 100.0
"""Innovations count up to so many of their standard deviations. A jump of a sensor is far: less would shrink it."""


class ResponseFunctions:
    """The functions behind the responses of one model to what happens at some sites; made once, used at many points.

    Parameters
    ----------
    model
        The model.
    dt
        Sampling interval [s].
    columns
        Indices of the outputs that count (m,).
    sites
        Names of the sites that are asked about.
    constants
        Names of the constants that are free beside any effect.
    degrees_of_freedom
        Of the innovations. Infinity, the Gaussian filter, follows a jump at once; Student's t takes it for an outlier.
    """

    def __init__(
        self,
        model: Model,
        dt: float,
        columns: Sequence[int],
        sites: Sequence[str] = (),
        constants: Sequence[str] = (),
        degrees_of_freedom: float = float("inf"),
    ) -> None:
        self.model, self.columns, self.sites, self.constants = model, tuple(columns), tuple(sites), tuple(constants)
        effects = [_probe(model, site) for site in sites]
        self.extended = model.with_effects(effects) if effects else model
        self.wrt = (*(e.parameter(e.terms[0].name) for e in effects), *constants)
        self.filter = RecordFilter(self.extended, dt, columns, (), degrees_of_freedom, self.wrt)
        self._each_row = self.extended.derived(_jacobians_row_by_row, dt, self.wrt, threading.get_ident())
        self.degrees_of_freedom = degrees_of_freedom

    def at(
        self, record: Dataset, noise: NoiseModel, p: FloatArray, start: tuple[FloatArray, FloatArray]
    ) -> LinearResponse:
        """Run the filter and take the derivatives along it.

        Parameters
        ----------
        record
            N rows without a gap; a missing output is NaN.
        noise
            Process and measurement noise.
        p
            Parameters of the model (np,).
        start
            z0 (nx,) and P0 (nx, nx) before the first row.
        """
        return self.along(record, noise, p, self.filter.run(record, noise, *start, self._values(p)))

    def along(self, record: Dataset, noise: NoiseModel, p: FloatArray, filtered: Filtered) -> LinearResponse:
        """The derivatives along a run of the filter with this noise and these parameters (np,)."""
        return LinearResponse(self, record, noise, p, filtered, self._jacobians(record, filtered, self._values(p)))

    def _values(self, p: FloatArray) -> FloatArray:
        """Parameters of the extended model, those of the model itself (np,) as they are given."""
        values = self.extended.parameter_values
        values[: len(p)] = p
        return values

    def _jacobians(self, record: Dataset, filtered: Filtered, p: FloatArray) -> Jacobians:
        each = {"x": filtered.z[:-1], "t": record.time[:-1, None], "u": record.inputs[1:], "p": p}
        found, count, rows = self._each_row({}, each), len(record) - 1, list(self.columns)
        heights = {"dx": len(self.extended.states), "dy": len(self.extended.outputs)}
        widths = {"dx": len(self.extended.states), "dtheta": len(self.wrt)}
        fx, fp, hx, hp = (  # a matrix comes column by column
            found[f"{of}_{by}"].reshape(count, width, height).transpose(0, 2, 1)
            for of, height in heights.items()
            for by, width in widths.items()
        )
        return Jacobians(fx, fp, hx[:, rows], hp[:, rows])


class Jacobians(NamedTuple):
    """Derivatives of next state and outputs by the state and by what is asked about, for each interval."""

    F: FloatArray
    b: FloatArray
    H: FloatArray
    h: FloatArray


class LinearResponse:
    """Innovations of one model on one record, and their derivatives by sites and constants.

    Attributes
    ----------
    innovations
        Scaled by their standard deviations, row by row: (N - 1) m values; 0 where an output is missing.
    by_constants
        Their derivatives by minus the constants ((N - 1) m, c): what a fit of the constants can explain.
    """

    def __init__(
        self,
        functions: ResponseFunctions,
        record: Dataset,
        noise: NoiseModel,
        p: FloatArray,
        filtered: Filtered,
        jacobians: Jacobians,
    ) -> None:
        self.record, self._functions, self._p, self._filtered = record, functions, p, filtered
        columns, (F, b, H, h) = list(functions.columns), jacobians
        there = np.isfinite(record.outputs[1:][:, columns])
        K, S = _gains(filtered, H, noise.std(functions.extended)[columns], there)
        e = np.where(there, record.outputs[1:][:, columns] - filtered.predicted[1:], 0.0)
        K = K * weight_of(e**2 / S, functions.degrees_of_freedom)[:, None, :]
        self._H, self._h, self._A, self._B = H, h, F - F @ K @ H, b - F @ K @ h
        self._weight = np.where(there, 1 / np.sqrt(S), 0.0)
        self.innovations: FloatArray = np.clip(e * self._weight, -CLIP, CLIP).ravel()
        first = len(functions.sites)
        self.by_constants = self._constants(range(first, first + len(functions.constants)))

    def respond(self, site: str, course: FloatArray) -> FloatArray:
        """What changes of the value at a site explain of the innovations.

        Parameters
        ----------
        site
            One of the sites.
        course
            Change of the value in each interval (N - 1, f), in the site's unit, for f courses at once.

        Returns
        -------
        numpy.ndarray
            ((N - 1) m, f), scaled like the innovations.
        """
        which = self._functions.sites.index(site)
        return self._respond(np.full(course.shape[1], which), course)

    def _constants(self, which: Sequence[int]) -> FloatArray:
        """All constants at once: the course of each is 1 throughout."""
        return self._respond(np.array(which, dtype=np.intp), np.ones((len(self._H), len(which))))

    def _respond(self, source: NDArray[np.intp], course: FloatArray) -> FloatArray:
        """Responses ((N - 1) m, f) to courses (N - 1, f), each of what is asked about at a place (f,)."""
        start = np.zeros((self._A.shape[1], len(source)))
        moved = linear_run((self._A, self._B, self._H, self._h), start, source, course, as_machine_code=True)
        moved *= self._weight[:, :, None]
        return moved.reshape(self._weight.size, len(source))

    def shown_by(self, site: str) -> tuple[FloatArray, float] | None:
        """What the output shows that changes one to one with a sensor (N,), and its noise from row to row.

        None where there is no such output.
        """
        own = self._h[:, :, self._functions.sites.index(site)]
        shown = [c for j, c in enumerate(self._functions.columns) if np.allclose(own[:, j], 1.0)]
        if len(shown) != 1:
            return None
        return self.record.outputs[:, shown[0]], float(noise_floor([self.record], shown)[0])

    def seen(self) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
        """Value at each site, and of each input, state and signal, in the interval that leads to each row (N - 1,)."""
        model, record, n = self._functions.model, self.record, len(self.record) - 1
        states, inputs, table = self._filtered.z[:-1].T, record.inputs[1:].T, np.tile(self._p[:, None], n)
        found = model.ode.map(n)(record.time[None, :-1], states, inputs, table)
        at = np.array(model.site_values.map(n)(record.time[None, :-1], states, inputs, table, found[3]))
        drivers = dict(zip(model.names("inputs"), inputs, strict=True)) | dict(
            zip(model.names("states"), states, strict=True)
        )
        if model.signals:
            drivers |= dict(zip((s.name for s in model.signals), np.array(found[2]), strict=True))
        return {s.name: at[i] for i, s in enumerate(model.sites)}, drivers


def weight_of(square: FloatArray, nu: float) -> FloatArray:
    """Weight of innovations by squared distance, as in the filter (`greybox.filtering.step`); 1 for the Gaussian."""
    return np.ones_like(square) if np.isinf(nu) else (nu + 1) / (nu + square)


def _jacobians_row_by_row(model: Model, dt: float, wrt: tuple[str, ...], thread: int) -> RowByRow:
    """Derivatives of one step, with the working memory of one thread; folds of a record ask for the same."""
    del thread
    return interval_by_interval(
        steps_along(model, dt, wrt),
        lambda: jacobians_at_the_end(model, dt, wrt),
        lambda: Stepper(model, dt).one_step_jacobians(list(wrt)),
        {},
        ("p",),
    )


def _probe(model: Model, site: str) -> Effect:
    """An effect whose first coefficient is added to the value at a site, under a name that is still free."""
    taken = {e.label for e in model.effects}
    shift = Effect(site, "constant", "shift", mode="offset")
    return shift if shift.label not in taken else Effect(site, "own_value", "span", settings={"middle": 0.0})


def _gains(filtered: Filtered, H: FloatArray, r: FloatArray, there: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Gain of the filter (N - 1, nx, m), nothing for a missing output, and variances of the innovations (N - 1, m)."""
    P = filtered.P[:-1] + np.diag(filtered.Q)
    spread = P @ H.transpose(0, 2, 1)
    S = H @ spread + np.diag(r**2)
    variances = np.einsum("kii->ki", S).copy()
    gone = ~there
    both = gone[:, :, None] | gone[:, None, :]
    alone = np.where(both, np.eye(len(r)) * variances[:, :, None], S)
    right = np.where(gone[:, None, :], 0.0, spread).transpose(0, 2, 1)
    return _solved(alone, right).transpose(0, 2, 1), variances


def _solved(A: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions of systems (N, m, m) with right sides (N, m, n); NaN of a system that has none.

    A trial far off may have a factor of e^20 at a sensor: its outputs are then one and the same to the last digit.
    """
    try:
        return np.asarray(np.linalg.solve(A, right), dtype=float)
    except np.linalg.LinAlgError:
        rank = np.zeros(len(A), dtype=int)
        finite = np.isfinite(A).all(axis=(1, 2))
        rank[finite] = np.linalg.matrix_rank(A[finite], hermitian=True)
        found = np.full_like(right, np.nan)
        regular = rank == A.shape[1]
        found[regular] = np.linalg.solve(A[regular], right[regular])
        return found
