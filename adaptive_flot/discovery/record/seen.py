"""What was seen at every site, and of every driver, along a run of a model."""

from __future__ import annotations

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper

Seen = dict[str, FloatArray]


def seen_along(model: Model, record: Dataset, x0: FloatArray) -> tuple[Seen, Seen]:
    """Values at every site, and of every driver, along a free run from a state (nx,); each (N,)."""
    p, n = model.parameter_values, len(record)
    run = Stepper(model, record.dt).simulate(x0, record.inputs[1:], p, float(record.time[0]))
    states, table = np.vstack([x0, run.states]), np.tile(p[:, None], n)
    drivers = dict(zip(model.names("inputs"), record.inputs.T, strict=True))
    drivers |= dict(zip(model.names("states"), states.T, strict=True))
    if model.signals:
        drivers |= {s.name: np.concatenate([[c[0]], c]) for s, c in zip(model.signals, run.signals.T, strict=True)}
    wanted = model.drivers or (*model.names("inputs"), *model.names("states"))
    z = model.ode.map(n)(record.time, states.T, record.inputs.T, table)[3]
    at = np.array(model.site_values.map(n)(record.time, states.T, record.inputs.T, table, z))
    return {s.name: at[i] for i, s in enumerate(model.sites)}, {d: drivers[d] for d in wanted if d in drivers}
