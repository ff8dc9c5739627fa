"""How each output would respond to a small change at each site: the model linearised along a fitted free run.

One pass gives the one-step Jacobians of every row. The response to *any* time profile at *any* site is then a product
of small matrices. So a whole catalogue of effects is scored for the price of one sensitivity simulation. At amplitude
zero this is exact: a driver's own feedback is of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.record.problem import BoolArray, Problem
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.linear_run import linear_run
from adaptive_flot.greybox.stepping.nodes import IntArray, Nodes, NodeStepper, substeps
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.greybox.stepping.row_jacobians import row_jacobians
from adaptive_flot.greybox.stepping.stepper import MOST_UNROLLED, Stepper

FILLED_AT_ONCE = 64
"""Rows of responses that are filled in one go: more would not stay in a cache, and fresh memory is slow."""
TAKEN_UP = 1.5e-3
"""What is left of a response, as a share of it, that is rounding and curvature: what is free already takes it up."""
HALF = 0.5
"""Share of a change, and weight of the rows around a row, that are most of it."""
LEAST_VALUE = 1e-6
"""Share of its largest value below which a site is at zero."""


@dataclass(frozen=True)
class TimeProfile:
    """A time profile at a site.

    Attributes
    ----------
    site
        Name of the site.
    values
        Change of the logarithm of its value, or of the value itself where `offset`, (N,).
    offset
        Which of the two.
    response
        What the measured outputs do (N, m), where that is not the linear response to the values.
    """

    site: str
    values: FloatArray
    offset: bool
    response: FloatArray | None = None


class Responses:
    """Linear responses of the measured outputs along one fitted free run.

    Attributes
    ----------
    sites
        Names of the sites.
    drivers
        Series (N,) of each quantity that an effect may depend on.
    site_values
        Series (N,) of the value at each site (the first component), at the times of the rows.
    nuisance
        Responses (N, m, r) to the parameters that are free already and to the initial state.
    """

    def __init__(self, problem: Problem, fit: Fit) -> None:
        self.problem, self.fit = problem, fit
        model = fit.model
        self.sites = tuple(s.name for s in model.sites)
        self._offset = {s.name: s.mode == "offset" for s in model.sites}
        has = {e.label for e in model.effects}
        probes = [Effect(s, "constant", "shift") for s in self.sites]
        extended = model.with_effects([e for e in probes if e.label not in has])
        p0 = np.array([q.value for q in extended.parameters])
        stepper = self._simulated(extended, problem.nodes, p0)
        if not np.isfinite(self._at).all():  # a fit that was made at every row may be too fast for coarser steps
            stepper = self._simulated(extended, None, p0)
        self.states = self._spread(self._at)
        names = (*fit.names, *(e.parameter("amplitude") for e in probes))
        self._jacobians(stepper, names, p0)
        self._q = len(fit.names)
        self._describe(extended, p0)
        self.nuisance = self._nuisance()

    def _simulated(self, model: Model, nodes: Nodes | None, p: FloatArray) -> Stepper:
        """The stepper of the run, at these nodes or by the model's own steps, and what it came to."""
        record, stepper = self.problem.record, Stepper(model, self.problem.record.dt)
        if nodes is None and stepper.substeps > MOST_UNROLLED:
            nodes = substeps(record, stepper.substeps)
        self._nodes = nodes
        if nodes is not None:
            stepper = NodeStepper(model)
        self._steps = record.inputs[1:] if nodes is None else nodes.inputs
        run = stepper.simulate(self.fit.initial_state, self._steps, p, float(record.time[0]))
        self._at = np.vstack([self.fit.initial_state, run.states])
        return stepper

    def _jacobians(self, stepper: Stepper, names: tuple[str, ...], p: FloatArray) -> None:
        time = self.problem.record.time if self._nodes is None else self._nodes.times
        n = len(self._steps)
        self._A, self._G, self._C, self._H = row_jacobians(stepper, self._at[:n], time[:n], self._steps, p, names)
        columns = list(self.problem.columns)
        self._C, self._H = self._C[:, columns], self._H[:, columns]
        # what moves no state acts at once: such responses are worked out at all rows, between the nodes too
        self._at_once = np.logical_not(np.any(self._G != 0, axis=(0, 1)))
        self._direct = self._spread(np.concatenate([self._H[:1], self._H]))

    def _spread(self, values: FloatArray, rows: IntArray | None = None) -> FloatArray:
        """Values at all rows, or some of them, from values at the rows that were simulated."""
        if self._nodes is None:
            return values if rows is None else values[rows]
        return self._nodes.spread(values, rows)

    def _describe(self, model: Model, p: FloatArray) -> None:
        """Series of drivers and of the values at the sites."""
        record = self.problem.record
        z_of, value_of = model.ode.map(len(record)), model.site_values.map(len(record))
        arguments = record.time, self.states.T, record.inputs.T, p
        _, _, s, z = z_of(*arguments)
        # states between nodes are drawn, and at a kink there may be no algebraic variables that belong to them
        values, signals = (_filled(np.array(each)) for each in (value_of(*arguments, z), s))
        table = {q.name: record.inputs[:, j] for j, q in enumerate(model.inputs)}
        table |= {q.name: self.states[:, j] for j, q in enumerate(model.states)}
        table |= {q.name: signals[j] for j, q in enumerate(model.signals)}
        names = self.fit.model.drivers or (*self.fit.model.names("inputs"), *self.fit.model.names("states"))
        own = tuple(f"{e.label}." for e in self.fit.model.effects)  # states of an effect drive nothing else
        self.drivers = {name: table[name] for name in names if not name.startswith(own)}
        self.site_values = {s.name: values[j] for j, s in enumerate(model.sites)}

    def is_offset(self, site: str) -> bool:
        """Whether effects add to the value at a site, or else multiply it."""
        return self._offset[site]

    def usual(self, site: str) -> float:
        """Typical size of the value at a site: the median, or the mean of what is off most of the time.

        Of a site whose own value is zero, what moves the outputs by as much as they move (see `sizes`).
        """
        size = np.abs(self.site_values[site])
        return float(np.median(size)) or float(np.mean(size)) or self.sizes[site]

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Ordinary size of a change at each site, in its unit: what moves an output by as much as it moves.

        With the responses r_j (N,) of the outputs y_j to a constant change by one unit::

            size = min over j of sd(y_j) / rms(r_j)

        It knows nothing of where a scale has its zero, nor of its unit; zero where no output responds.
        """
        ones = np.ones(len(self.problem.record))
        responses = self.of([TimeProfile(s, ones, True) for s in self.sites])
        spread = np.nan_to_num(np.nanstd(self.problem.measured, axis=0))[:, None]
        size = np.sqrt(np.mean(responses**2, axis=0))
        with np.errstate(divide="ignore", invalid="ignore"):
            each = np.where((size > 0) & (spread > 0), spread / size, np.inf)
        least = np.min(each, axis=0)
        return dict(zip(self.sites, np.where(np.isfinite(least), least, 0.0).tolist(), strict=True))

    def _nuisance(self) -> FloatArray:
        directions = self.fit.directions
        n, r = len(self.problem.record), directions.shape[1]
        S = np.hstack([np.zeros((len(directions), self._q)), directions])
        inputs = np.zeros((n, self._q + r))
        inputs[:, : self._q] = 1.0
        return self._propagate(S, list(range(self._q)), inputs)

    def _propagate(
        self, S: FloatArray, source: list[int], profiles: FloatArray, rows: BoolArray | None = None
    ) -> FloatArray:
        """Responses (N, m, r): start S (nx, r), column of G and H of the first `len(source)`, profiles (N, r).

        What the profiles are in row k acts in the interval that ends there; in the first row the same as in the second.
        """
        m, r = len(self.problem.columns), S.shape[1]
        where = np.array(source, dtype=np.intp)
        at_once, slow = np.flatnonzero(self._at_once[where]), np.flatnonzero(~self._at_once[where])
        # those that move a state, then those that only start somewhere: a block is quicker than picked columns
        moving = np.concatenate([slow, np.arange(len(where), r)])
        source_of = where[slow]
        by_step = (profiles[1:] if self._nodes is None else self._nodes.means(profiles))[:, slow]
        out = np.empty((len(self._steps) + 1, m, len(moving)))
        out[1:] = linear_run(
            (self._A, self._G, self._C, self._H),
            S[:, moving],
            source_of,
            by_step,
            as_machine_code=self.fit.model.record_code,
        )
        out[0] = out[1]
        kept = np.arange(len(profiles)) if rows is None else np.flatnonzero(rows)
        responses = np.empty((len(kept), m, r))
        for first in range(0, len(kept), FILLED_AT_ONCE):
            part, part_of = responses[first : first + FILLED_AT_ONCE], kept[first : first + FILLED_AT_ONCE]
            part[:, :, moving] = self._spread(out, part_of)
            part[:, :, at_once] = self._direct[part_of][:, :, where[at_once]] * profiles[part_of][:, None, at_once]
        return responses

    def output_of(self, site: str) -> tuple[int, float] | None:
        """Index of the measured output that shows a site most, and its usual response to it; None where none does."""
        answers = self.of([TimeProfile(site, np.ones(len(self.site_values[site])), True)])[:, :, 0]
        strength = np.nanmedian(np.abs(answers) / self.problem.weights, axis=0)
        j = int(np.argmax(strength))
        own = float(np.median(answers[:, j]))
        return (j, own) if strength[j] > 0 and own else None

    def of(self, profiles: list[TimeProfile], rows: BoolArray | None = None) -> FloatArray:
        """Responses (N, m, r) of the measured outputs to r profiles; only of the true rows (N,), if given."""
        source = [self._q + self.sites.index(c.site) for c in profiles]
        table = np.empty((len(self.problem.record), len(profiles)))
        for j, c in enumerate(profiles):
            v = c.values
            default = self._offset[c.site]
            if c.offset and not default:
                v = v * self._inverse(c.site)
            elif default and not c.offset:
                v = v * self.site_values[c.site]
            table[:, j] = v
        table[0] = table[1]
        found = self._propagate(np.zeros((len(self.fit.initial_state), len(profiles))), source, table, rows)
        for j, c in enumerate(profiles):
            if c.response is not None:
                found[:, :, j] = c.response if rows is None else c.response[rows]
        return found

    def is_hidden(self, site: str, change: FloatArray) -> bool:
        """Whether most of a change (N,) falls where no small change at the site shows.

        So it is at a valve that is shut: a factor changes nothing there, nor does an opening below the least that the
        model knows.
        """
        column = self._q + self.sites.index(site)
        shows = np.any(self._G[:, :, column] != 0, axis=1) | np.any(self._H[:, :, column] != 0, axis=1)
        by_row = self._spread(np.concatenate([shows[:1], shows]).astype(float)[:, None])[:, 0] > HALF
        size = np.abs(change)
        return bool(size[~by_row].sum() > HALF * size.sum())

    def change_by(self, effect: Effect) -> FloatArray:
        """What an effect changes in the measured outputs (N, m) of a free run, everything else being as it is.

        Raises
        ------
        ModelError
            The fit has an effect of this name already.
        """
        return self._outputs_of(self.fit.model.with_effects([effect])) - self._plain_outputs

    @cached_property
    def _plain_outputs(self) -> FloatArray:
        return self._outputs_of(self.fit.model)

    def _outputs_of(self, model: Model) -> FloatArray:
        """Measured outputs (N, m) of a free run; one that leaves the model has no finite ones."""
        record = self.problem.record
        with np.errstate(all="ignore"):
            run = RecordSimulator(model, record.dt, self._nodes).outputs(
                record, self.fit.initial_state, model.parameter_values
            )
        measured: FloatArray = run[:, list(self.problem.columns)]
        return measured

    def _inverse(self, site: str) -> FloatArray:
        """One over the value at a site (N,), bounded: a pump that is off has no relative change."""
        value = self.site_values[site]
        least = LEAST_VALUE * float(np.max(np.abs(value), initial=0.0))
        inverse: FloatArray = np.where(np.abs(value) > least, 1 / np.where(np.abs(value) > least, value, 1.0), 0.0)
        return inverse

    def absorbed_constants(self) -> frozenset[tuple[str, str]]:
        """Sites, each with a mode, whose constant change all that is free already takes up, but for rounding."""
        if not self.nuisance.size:
            return frozenset()
        names: list[tuple[str, Mode]] = [(s, mode) for s in self.sites for mode in ("factor", "offset")]
        ones = np.ones(len(self.problem.record))
        responses = self.of([TimeProfile(s, ones, mode == "offset") for s, mode in names])
        scale = np.maximum(np.abs(responses).max(axis=(0, 2)), 1e-300)[None, :, None]
        a = (responses / scale).reshape(-1, len(names))
        b = (self.nuisance / scale).reshape(-1, self.nuisance.shape[2])
        base = np.linalg.qr(b / np.maximum(np.linalg.norm(b, axis=0), 1e-300))[0]
        left = np.linalg.norm(a - base @ (base.T @ a), axis=0)
        size = np.linalg.norm(a, axis=0)
        return frozenset(n for n, x, s in zip(names, left, size, strict=True) if x < TAKEN_UP * s)

    def adapted_sites(self) -> tuple[str, ...]:
        """Sites whose constant change does what a change of an adapted parameter does, and nothing else.

        A change in time at such a site is a drift of that parameter: what the adaptation is there for.
        """
        count = len(self.problem.adapted)
        if not count:
            return ()
        responses = self.of([TimeProfile(s, np.ones(len(self.problem.record)), self._offset[s]) for s in self.sites])
        scale = np.maximum(np.abs(responses).max(axis=(0, 2)), 1e-300)[None, :, None]
        a = (responses / scale).reshape(-1, len(self.sites))
        b = (self.nuisance[:, :, :count] / scale).reshape(-1, count)
        a, b = (x / np.maximum(np.linalg.norm(x, axis=0), 1e-300) for x in (a, b))
        alike = np.abs(a.T @ b).max(axis=1)
        return tuple(s for s, c in zip(self.sites, alike, strict=True) if c > 1 - 1e-6)


def _filled(series: FloatArray) -> FloatArray:
    """Series (k, N) in which what is not finite is drawn between its neighbours; a row without any stays as it is."""
    filled, rows = series.copy(), np.arange(series.shape[1])
    for own in filled:
        there = np.isfinite(own)
        if there.any() and not there.all():
            own[~there] = np.interp(rows[~there], rows[there], own[there])
    return filled
