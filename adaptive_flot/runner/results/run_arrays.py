"""What a run leaves behind as arrays, one row an interval: from the steps of the loop, or from runs side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.contracts import Plan, Sample, Setup, Status
from adaptive_flot.contracts.delayed_measurements import in_time
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.loop.loop import Step


@dataclass(frozen=True)
class RunArrays:
    """A run of N intervals, of an estimator with ny outputs, m of them driving, and q adapted parameters.

    Attributes
    ----------
    time
        End of each interval [s] (N,).
    inputs, acted
        Inputs as they are known and as they acted (N, nu).
    true, measured
        Outputs (N, ny), delayed values in their places; NaN where not measured.
    parameters, known
        True parameters of the plant's model (N, its np), and what is known of those of the estimator's model (N, np);
        None where nothing is.
    prediction, innovation
        Of the estimator (N, ny); NaN before it starts, as all that is its.
    innovation_std, estimates, covariance
        (N, m), (N, q) and (N, q, q).
    statuses
        Of the estimator, N of them.
    control_statuses, decided_by, messages, softened, solve_seconds, plans
        Of each decision; see `Decision`.
    faults
        Names of the injected faults that changed something in each interval.
    """

    time: FloatArray
    inputs: FloatArray
    acted: FloatArray
    true: FloatArray
    measured: FloatArray
    parameters: FloatArray
    known: FloatArray | None
    prediction: FloatArray
    innovation: FloatArray
    innovation_std: FloatArray
    estimates: FloatArray
    covariance: FloatArray
    statuses: Sequence[Status]
    control_statuses: Sequence[Status]
    decided_by: Sequence[str]
    messages: Sequence[str]
    softened: Sequence[Mapping[str, float]]
    solve_seconds: FloatArray
    plans: Sequence[Plan | None]
    faults: Sequence[tuple[str, ...]]

    @classmethod
    def of(cls, steps: Sequence[Step], setup: Setup) -> RunArrays:
        """Collect the steps of a run whose estimator was built for `setup`."""
        samples, estimates = [s.plant.sample for s in steps], [s.estimate for s in steps]
        outputs, driving, q = len(setup.model.outputs), len(setup.outputs), len(setup.parameters)
        known = None
        if any(s.parameters is not None for s in samples):
            blank = np.full(len(setup.model.parameters), np.nan)
            known = np.array([blank if s.parameters is None else s.parameters for s in samples])
        return cls(
            time=np.array([s.time for s in samples]),
            inputs=np.array([s.inputs for s in samples]),
            acted=np.array([s.plant.inputs for s in steps]),
            true=np.array([s.plant.outputs for s in steps]),
            measured=np.array([s.outputs for s in in_time(samples, setup)]),
            parameters=np.array([s.plant.parameters for s in steps]),
            known=known,
            prediction=np.array([e.prediction if e else np.full(outputs, np.nan) for e in estimates]),
            innovation=np.array([s.outputs for s in in_time(innovations(steps), setup)]),
            innovation_std=np.array([e.innovation_std if e else np.full(driving, np.nan) for e in estimates]),
            estimates=np.array([e.parameters if e else np.full(q, np.nan) for e in estimates]),
            covariance=np.array([e.covariance if e else np.full((q, q), np.nan) for e in estimates]),
            statuses=[e.status if e else Status.INITIALISING for e in estimates],
            control_statuses=[s.decision.status for s in steps],
            decided_by=[s.decision.decided_by for s in steps],
            messages=[s.decision.message for s in steps],
            softened=[s.decision.softened for s in steps],
            solve_seconds=np.array([s.decision.solve_seconds for s in steps]),
            plans=[s.decision.plan for s in steps],
            faults=[(*s.plant.faults, *s.decision.faults) for s in steps],
        )


def innovations(steps: Sequence[Step]) -> list[Sample]:
    """Innovations in place of the measurements, those of delayed values with the sample that they arrived with."""
    unknown = np.full(len(steps[0].plant.outputs), np.nan)
    return [
        replace(s.plant.sample, outputs=s.estimate.innovation, delayed=s.estimate.delayed)
        if s.estimate
        else replace(s.plant.sample, outputs=unknown, delayed=())
        for s in steps
    ]
