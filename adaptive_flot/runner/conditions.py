"""Fingerprint of what a scenario asks of its controllers: runs are compared only where it is the same."""

from __future__ import annotations

import hashlib
import json

from adaptive_flot.runner.scenario import Scenario

METHOD = {"description", "seeds", "estimators", "controllers", "cases", "published", "adapt", "initial_estimate"}
"""Keys of a scenario that say who runs and how it is told, not what is asked."""


def conditions(scenario: Scenario) -> str:
    """Twelve hexadecimal digits over plant, cell, inputs, drift, measurements, limits, prices and accounted time.

    Estimators, controllers and their options do not enter, so a copy of a scenario with another option compares with
    the original; nor do keys at their default, so a later version that adds a key does not part old results from new.
    """
    asked = scenario.file.model_dump(mode="json", exclude=METHOD, exclude_defaults=True)
    asked["starts_after"], asked["accounted_after"] = scenario.initial_rows, scenario.fits_after
    asked["cell"] = dict(zip(scenario.model.names("parameters"), scenario.model.parameter_values.tolist(), strict=True))
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:12]
