"""What was seen at every site, and of every driver, along the runs of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.fit import JointFit
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper


def seen_values(
    model: Model, fit: JointFit, records: Sequence[Dataset]
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Values at every site, and of every driver, along the free runs of a fit, the records behind one another."""
    stepper = Stepper(model, records[0].dt)
    sites: list[FloatArray] = []
    drivers: list[FloatArray] = []
    names = model.drivers or (*model.names("inputs"), *model.names("states"))
    p = model.with_parameters(fit.values).parameter_values
    for record, x0 in zip(records, fit.initial, strict=True):
        run = stepper.simulate(x0, record.inputs[1:], p, float(record.time[0]))
        states, n = np.vstack([x0, run.states]), len(record)
        columns = {**dict(zip(model.names("inputs"), record.inputs.T, strict=True)),
                   **dict(zip(model.names("states"), states.T, strict=True))}  # fmt: skip
        if model.signals:
            columns |= {s.name: np.concatenate([[c[0]], c]) for s, c in zip(model.signals, run.signals.T, strict=True)}
        drivers.append(np.column_stack([columns[d] for d in names if d in columns]))
        z = model.ode.map(n)(record.time, states.T, record.inputs.T, np.tile(p[:, None], n))[3]
        at = model.site_values.map(n)(record.time, states.T, record.inputs.T, np.tile(p[:, None], n), z)
        sites.append(np.array(at).T)
    together, moved = np.vstack(sites), np.vstack(drivers)
    known = [d for d in names if d in {*model.names("inputs"), *model.names("states"), *model.names("signals")}]
    return (
        {s.name: together[:, i] for i, s in enumerate(model.sites)},
        {d: moved[:, i] for i, d in enumerate(known)},
    )
