"""Derivatives of the residuals of a joint fit by its unknowns: exact ones, carried along the runs themselves.

The free run y(x0, p) of a record starts at x0(z) with parameters p(z). With its derivatives along the run, see
`Stepper.simulate_sensitivities`, those of a scaled error r = (measured - y) / s by the unknowns z are::

    dr/dz = -(dy/dp dp/dz + dy/dx0 dx0/dz) / s
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.hypotheses.joint.rows import HUGE, Rows
from adaptive_flot.discovery.hypotheses.joint.unknowns import JointUnknowns
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.stepping.record import RecordSimulator


def exact_slopes(
    simulator: RecordSimulator, rows: Rows, u: JointUnknowns, z: FloatArray, errors: Sequence[FloatArray]
) -> FloatArray | None:
    """Derivatives of the residuals by all unknowns: rows are scaled errors, (N m,) a record, and then priors.

    Parameters
    ----------
    simulator
        Free runs of the model.
    rows
        Records and rows.
    u, z
        The unknowns, and their values.
    errors
        Measured minus free run of each record (N, m), there.

    Returns
    -------
    ndarray or None
        (n, unknowns); None where a run with derivatives would be no quicker than one for each unknown.
    """
    names = (*u.coefficients, *u.constants.names)
    if not all(simulator.has_quick_slopes(record, names) for record in rows.records):
        return None
    p, by_unknown = u.parameters(z), u.parameter_slopes(z)
    start = np.hstack([np.zeros((u.nx, len(names))), np.diag(u.state_scale)])
    blocks = []
    for i, record in enumerate(rows.records):
        with np.errstate(all="ignore"):
            _, moved, _ = simulator.sensitivities(record, u.first(i, z), p, names, start)
            moved = moved[:, list(rows.columns)] / -rows.sizes[i][:, :, None]
            counts = rows.there(i) & (np.abs(errors[i] / rows.sizes[i]) < HUGE)
        moved = np.where(counts[:, :, None] & np.isfinite(moved), moved, 0.0)
        block = np.zeros((*errors[i].shape, len(z)))
        block[:, :, : len(names)] = moved[:, :, : len(names)] @ by_unknown
        begin = len(names) + i * u.nx
        block[:, :, begin : begin + u.nx] = moved[:, :, len(names) :]
        blocks.append(block.reshape(-1, len(z)))
    priors = np.hstack([np.zeros((len(z) - u.q, u.q)), np.diag(u.weights())])
    return np.concatenate([*blocks, priors])
