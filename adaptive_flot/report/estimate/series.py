"""From a replayed record to what the figures draw."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd

from adaptive_flot.charts.palette import contender_slots
from adaptive_flot.charts.plotdata import Mark, Panel, Role, Trace
from adaptive_flot.greybox.model import Quantity
from adaptive_flot.report.kit.wording import spaced
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.commands.replay import Replay

Block = Literal["fit", "test"]


def measured_outputs(result: RecordEstimate) -> list[Quantity]:
    """Outputs that the record holds."""
    columns = result.replays[0].table.columns
    return [q for q in result.setup.model.outputs if f"{q.column}_measured" in columns]


def roles(result: RecordEstimate) -> dict[str, tuple[Role, int]]:
    """Role and colour of each estimator: `fixed` is the constant model."""
    slots = contender_slots([("", r.estimator) for r in result.replays])
    return {
        who: (Role.CONSTANT if who == "fixed" else Role.ESTIMATE, slots["", who])
        for who in (r.estimator for r in result.replays)
    }


def block_marks(result: RecordEstimate) -> tuple[Mark, ...]:
    """Where the test block begins, if it goes on from the fit block."""
    return (Mark(float(result.blocks.test.time[0]), "test block"),) if result.blocks.continues else ()


def _shown(result: RecordEstimate, replay: Replay, block: Block | None = None) -> pd.DataFrame:
    """Rows of a block; without one both blocks where they follow each other in time, else the test block."""
    if block is None and result.blocks.continues:
        return replay.table
    return replay.table[replay.table["block"] == (block or "test")]


def free_run_panels(result: RecordEstimate) -> list[Panel]:
    """Each measured output: measured values, and the free run of each estimator's model."""
    panels = []
    for q in measured_outputs(result):
        first = _shown(result, result.replays[0])
        time = first["time_s"].to_numpy()
        traces = [Trace("measured", time, first[f"{q.column}_measured"].to_numpy(), Role.TRUTH)]
        for replay in result.replays:
            role, index = roles(result)[replay.estimator]
            values = _shown(result, replay)[f"{q.column}_free_run"].to_numpy()
            traces.append(Trace(replay.estimator, time, values, role, index))
        panels.append(Panel(spaced(q.name), q.unit, tuple(traces), height=1.2))
    return panels


def input_panels(result: RecordEstimate) -> list[Panel]:
    """Inputs of the blocks shown."""
    blocks = result.blocks
    records = (blocks.fit, blocks.test) if blocks.continues else (blocks.test,)
    time, inputs = (np.concatenate([getattr(r, name) for r in records]) for name in ("time", "inputs"))
    panels = []
    for j, q in enumerate(result.setup.model.inputs):
        panels.append(Panel(spaced(q.name), q.unit, (Trace("", time, inputs[:, j], Role.TRUTH, held=True),), 0.7))
    return panels


def output_panels(result: RecordEstimate, q: Quantity, block: Block | None = None) -> list[Panel]:
    """One output: measured and predicted one step ahead, and below the error of each prediction."""
    first = _shown(result, result.replays[0], block)
    time = first["time_s"].to_numpy()
    traces = [Trace("measured", time, first[f"{q.column}_measured"].to_numpy(), Role.TRUTH)]
    errors = []
    for replay in result.replays:
        role, index = roles(result)[replay.estimator]
        own = _shown(result, replay, block)
        traces.append(Trace(replay.estimator, time, own[f"{q.column}_predicted"].to_numpy(), role, index))
        errors.append(Trace(replay.estimator, time, -own[f"{q.column}_innovation"].to_numpy(), role, index))
    zoom = any(t.role is Role.ESTIMATE for t in errors)
    return [
        Panel(spaced(q.name), q.unit, tuple(traces), height=1.2),
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
