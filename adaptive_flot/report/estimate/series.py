"""From a replayed record to what the figures draw."""

from __future__ import annotations

from typing import Literal

from adaptive_flot.greybox.model import Quantity
from adaptive_flot.report.kit.plotdata import Panel, Role, Trace
from adaptive_flot.runner.commands.estimate import RecordEstimate

Block = Literal["fit", "test"]


def measured_outputs(result: RecordEstimate) -> list[Quantity]:
    """Outputs that the record holds."""
    columns = result.replays[0].table.columns
    return [q for q in result.setup.model.outputs if f"{q.column}_measured" in columns]


def roles(result: RecordEstimate) -> dict[str, tuple[Role, int]]:
    """Role and colour of each estimator: `fixed` is the constant model; the others get a colour each."""
    role_of: dict[str, tuple[Role, int]] = {}
    for replay in result.replays:
        role = Role.CONSTANT if replay.estimator == "fixed" else Role.ESTIMATE
        role_of[replay.estimator] = role, sum(r is role for r, _ in role_of.values())
    return role_of


def input_panels(result: RecordEstimate) -> list[Panel]:
    """Inputs of the fit block."""
    record = result.blocks.fit
    panels = []
    for j, q in enumerate(result.setup.model.inputs):
        trace = Trace("input", record.time, record.inputs[:, j], Role.ESTIMATE, held=True)
        panels.append(Panel(q.name.replace("_", " "), q.unit, (trace,), height=0.7))
    return panels


def output_panels(result: RecordEstimate, q: Quantity, block: Block) -> list[Panel]:
    """One output over one block: measured and predicted one step ahead, and below the error of each prediction."""
    first = result.replays[0].table
    rows = first[first["block"] == block]
    time = rows["time_s"].to_numpy()
    traces = [Trace("measured", time, rows[f"{q.column}_measured"].to_numpy(), Role.TRUTH)]
    errors = []
    for replay in result.replays:
        role, index = roles(result)[replay.estimator]
        own = replay.table[replay.table["block"] == block]
        traces.append(Trace(replay.estimator, time, own[f"{q.column}_predicted"].to_numpy(), role, index))
        errors.append(Trace(replay.estimator, time, -own[f"{q.column}_innovation"].to_numpy(), role, index))
    zoom = any(t.role is Role.ESTIMATE for t in errors)
    return [
        Panel(q.name.replace("_", " "), q.unit, tuple(traces), height=1.2),
        Panel("predicted − measured", q.unit, tuple(errors), zoom=zoom),
    ]


def parameter_panels(result: RecordEstimate) -> list[Panel]:
    """Each fitted parameter over time as each estimator has it, with its standard deviation."""
    panels = []
    for e in result.batch.estimates:
        traces = []
        for replay in result.replays:
            role, index = roles(result)[replay.estimator]
            rows = replay.table if result.blocks.continues else replay.table[replay.table["block"] == "fit"]
            values, std = rows[f"{e.label}_estimate"].to_numpy(), rows[f"{e.label}_std"].to_numpy()
            traces.append(Trace(replay.estimator, rows["time_s"].to_numpy(), values, role, index, std=std))
        panels.append(Panel(e.label, e.unit, tuple(traces)))
    return panels
