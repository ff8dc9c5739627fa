"""From runs to what the figures draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from adaptive_flot.charts.palette import contender_slots
from adaptive_flot.charts.plotdata import Panel, Role, Trace
from adaptive_flot.charts.units import amount
from adaptive_flot.greybox.model import FloatArray, Quantity
from adaptive_flot.report.kit.plotdata import Residuals, Spread
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.whiteness import ljung_box_p
from adaptive_flot.runner.scenario.scenario import Scenario

FEWEST_SEEDS = 5
"""Seeds from which a distribution is worth a figure."""


@dataclass(frozen=True)
class CaseRuns:
    """The runs of one scenario with one controller: what one chapter of the report shows."""

    scenario: Scenario
    controller: str
    runs: tuple[Run, ...]
    slots: Mapping[tuple[str, str], int]
    """Colour of each (controller, estimator) of the scenario."""

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seeds in the order run."""
        return tuple(dict.fromkeys(r.seed for r in self.runs))

    @cached_property
    def first(self) -> dict[str, Run]:
        """Run of the first seed by estimator: what the time series show."""
        return {r.estimator: r for r in self.runs if r.seed == self.seeds[0]}

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Labels of the adapted parameters."""
        model = self.scenario.model
        return tuple(model.parameters[i].label for i in model.indices("parameters", self.scenario.setup.parameters))

    @cached_property
    def outputs(self) -> tuple[Quantity, ...]:
        """Driving outputs."""
        model = self.scenario.model
        return tuple(model.outputs[i] for i in model.indices("outputs", self.scenario.setup.outputs))

    @cached_property
    def roles(self) -> dict[str, tuple[Role, int]]:
        """Role and colour index of each estimator: constant is one whose estimates never move."""
        role_of: dict[str, tuple[Role, int]] = {}
        for name, run in self.first.items():
            moves = any(changes(run.table[f"{x}_estimate"].to_numpy()) for x in self.labels)
            role = Role.ESTIMATE if moves else Role.CONSTANT
            role_of[name] = (role, self.slots[self.controller, name])
        return role_of

    @property
    def closed_loop(self) -> bool:
        """Whether the runs have an account, so limits and prices."""
        return any(run.account for run in self.runs)

    @property
    def several_controllers(self) -> bool:
        """Whether the scenario names more than one controller."""
        return len(self.scenario.file.controllers) > 1

    def of(self, estimator: str) -> list[Run]:
        """Runs of one estimator, one a seed."""
        return [r for r in self.runs if r.estimator == estimator]

    def fits(self, estimator: str, quantity: str) -> FloatArray:
        """Fits [%] over the seeds (S,), NaN where the estimate was not finite."""
        return np.array([r.fit[quantity] for r in self.of(estimator) if quantity in r.fit])

    def published(self, estimator: str, quantity: str) -> float | None:
        """Published fit [%], None where there is none."""
        part = self.scenario.file.published
        return part.fits.get(estimator, {}).get(quantity) if part else None

    def shown(self, run: Run) -> pd.DataFrame:
        """Rows of a run that the report shows and the fits use: t > `fits_after_s`."""
        if id(run) not in self._shown:
            self._shown[id(run)] = run, run.table[run.table["time_s"] > self.scenario.fits_after + 1e-9]
        return self._shown[id(run)][1]

    @cached_property
    def _shown(self) -> dict[int, tuple[Run, pd.DataFrame]]:
        """What `shown` has cut out, with its run: a page asks for it ten times a run."""
        return {}


def cases(results: Sequence[tuple[Scenario, Sequence[Run]]]) -> list[CaseRuns]:
    """Split results into one case for each scenario and controller, in the order run."""
    return [
        CaseRuns(scenario, controller, tuple(r for r in runs if r.controller == controller), _slots(runs))
        for scenario, runs in results
        for controller in dict.fromkeys(r.controller for r in runs)
    ]


def _slots(runs: Sequence[Run]) -> dict[tuple[str, str], int]:
    return contender_slots((r.controller, r.estimator) for r in runs)


def input_panels(case: CaseRuns) -> tuple[list[Panel], list[str]]:
    """Panels of the inputs that move, and a phrase for each that does not ("feed flow 0.000167 m3/s")."""
    panels, still = [], []
    inputs = case.scenario.model.inputs
    resting = not any(changes(v) for q in inputs for _, _, v in _distinct(case, q.column))  # then all are shown
    for q in inputs:
        name = q.name.replace("_", " ")
        lines = _distinct(case, q.column)
        if not resting and not any(changes(values) for _, _, values in lines):
            still.append(f"{name} {amount(float(lines[0][2][0]), q.unit)}")
            continue
        traces = [
            Trace(_suffixed("input", who), time, values, Role.ESTIMATE, j, held=True)
            for j, (who, time, values) in enumerate(lines)
        ]
        panels.append(Panel(name, q.unit, (*traces, *_followed(case, q))))
    return panels, still


def _followed(case: CaseRuns, q: Quantity) -> list[Trace]:
    """Return the true output that follows a set-point: `level` for `level_setpoint`."""
    names = [o.name for o in case.scenario.model.outputs]
    target = q.name.removesuffix("_setpoint")
    if target == q.name or target not in names:
        return []
    column = f"{case.scenario.model.outputs[names.index(target)].column}_true"
    return [
        Trace(_suffixed(target.replace("_", " "), who), time, values, Role.TRUTH, j)
        for j, (who, time, values) in enumerate(_distinct(case, column))
    ]


def parameter_panels(case: CaseRuns) -> list[Panel]:
    """Adapted parameters: truth, and each estimator with its standard deviation."""
    panels = []
    for label, name in zip(case.labels, case.scenario.setup.parameters, strict=True):
        unit = case.scenario.model.parameters[case.scenario.model.index("parameters", name)].unit
        traces = _truth(case, f"{label}_true")
        for who, (role, j) in case.roles.items():
            table = case.shown(case.first[who])
            time, values, std = (table[c].to_numpy() for c in ("time_s", f"{label}_estimate", f"{label}_std"))
            if np.array_equal(values, table[f"{label}_true"].to_numpy()):  # the oracle: its line is the truth's
                continue
            traces.append(Trace(_named(who, role), time, values, role, j, std=std))
        panels.append(Panel(label, unit, tuple(traces)))
    return panels


def output_panels(case: CaseRuns) -> list[Panel]:
    """Driving outputs: truth and predictions, and below the error of each prediction on its own scale."""
    panels = []
    for q in case.outputs:
        traces, errors = _truth(case, f"{q.column}_true"), []
        for who, (role, j) in case.roles.items():
            table = case.shown(case.first[who])
            time, true, predicted = (
                table[f"{c}"].to_numpy() for c in ("time_s", f"{q.column}_true", f"{q.column}_predicted")
            )
            traces.append(Trace(_named(who, role), time, predicted, role, j))
            errors.append(Trace(_named(who, role), time, predicted - true, role, j))
        name = q.name.replace("_", " ")
        noise = case.scenario.file.measurements[q.name].noise_std
        panels.append(Panel(name, q.unit, tuple(traces), height=1.3))
        panels.append(
            Panel("predicted − true", q.unit, tuple(errors), zoom=True, band=noise, band_label="±1σ of the noise")
        )
    return panels


def residuals(case: CaseRuns, run: Run, output: Quantity) -> Residuals:
    """Innovations of a run for one output, divided by the standard deviation the estimator expects."""
    table = case.shown(run)
    values = table[f"{output.column}_innovation"].to_numpy() / table[f"{output.column}_innovation_std"].to_numpy()
    role, j = case.roles[run.estimator]
    return Residuals(_named(run.estimator, role), role, j, table["time_s"].to_numpy(), values, ljung_box_p(values))


def spreads(case: CaseRuns) -> list[Spread]:
    """Fits over the seeds; empty when there are fewer than five seeds."""
    if len(case.seeds) < FEWEST_SEEDS:
        return []
    quantities_spread = []
    for quantity in (*case.labels, *(q.name for q in case.outputs)):
        published = {who: case.published(who, quantity) for who in case.roles}
        known = {who: value for who, value in published.items() if value is not None}
        label = f"fit of {quantity.replace('_', ' ')} [%]"
        quantities_spread.append(Spread(label, {who: case.fits(who, quantity) for who in case.roles}, known))
    return quantities_spread


def _distinct(case: CaseRuns, column: str) -> list[tuple[str, FloatArray, FloatArray]]:
    """(estimator, time, values) of each different time series; in open loop there is one, and it gets no name."""
    distinct: list[tuple[str, FloatArray, FloatArray]] = []
    for name, run in case.first.items():
        table = case.shown(run)
        values = table[column].to_numpy()
        if not any(np.array_equal(values, other, equal_nan=True) for _, _, other in distinct):
            distinct.append((name, table["time_s"].to_numpy(), values))
    return distinct if len(distinct) > 1 else [("", *distinct[0][1:])]


def _truth(case: CaseRuns, column: str) -> list[Trace]:
    distinct = enumerate(_distinct(case, column))
    return [Trace(_suffixed("truth", who), time, values, Role.TRUTH, j) for j, (who, time, values) in distinct]


def _suffixed(text: str, who: str) -> str:
    return f"{text} ({who})" if who else text


def _named(who: str, role: Role) -> str:
    return f"{who} (constant)" if role is Role.CONSTANT else who


def changes(values: FloatArray) -> bool:
    """Whether the finite values differ."""
    finite = values[np.isfinite(values)]
    return bool(len(finite) and np.ptp(finite) > 0)
