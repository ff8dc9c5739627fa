"""RPEM with what the paper leaves out: propagated sensitivities, stabilised forgetting, freezing."""

from __future__ import annotations

from typing import Any

from adaptive_flot.contracts import Setup
from estimators.rpem.estimator import Rpem


def rpem_full(setup: Setup, **options: Any) -> Rpem:
    """Build an `Rpem` with the recursive gradient; options as there, with other defaults.

    One tuning for all scenarios: a memory of 10 samples that forgets to 5 %
    (`python -m benchmarks.estimation.forgetting`), and directions on which the last 200 s say less
    than that are frozen (`freeze_s: null` never freezes).
    """
    chosen: dict[str, Any] = {"forgetting": 0.9, "gradient": "recursive", "forget_to": 0.05, "freeze_s": 200.0}
    if "forget_to" in options and options["forget_to"] is None:
        chosen["freeze_s"] = None
    return Rpem(setup, **(chosen | options))
