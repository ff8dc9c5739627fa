"""What an estimator says of its model: parameters that take up something else."""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.contracts import Status
from adaptive_flot.runner.commands.runs.run_result import Run

NOTABLE = 0.01
"""Share of samples from which it is told."""


def absorbed(who: str, runs: Sequence[Run]) -> list[str]:
    """A sentence on the share of the samples in which `who` returned `Status.MODEL_ERROR`; none below `NOTABLE`."""
    waiting, wrong = (s.name.lower() for s in (Status.INITIALISING, Status.MODEL_ERROR))
    told = sum(run.status_counts.get(wrong, 0) for run in runs)
    samples = sum(n for run in runs for name, n in run.status_counts.items() if name != waiting)
    if told < NOTABLE * max(samples, 1):
        return []
    return [
        f"{who}: in {told / samples:.0%} of the samples the parameters take up something else than their own changes. "
        "The model lacks an effect, or a constant is wrong; `adaptive-flot discover` looks for it."
    ]
