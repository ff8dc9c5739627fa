"""Fingerprint of what a scenario asks of its controllers: runs are compared only where it is the same."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from adaptive_flot.processes.model_file import is_model_file
from adaptive_flot.runner.scenario.scenario import Scenario

WHO = (
    "description",
    "seeds",
    "estimators",
    "controllers",
    "cases",
    "published",
    "adapt",
    "initial_estimate",
    "discovery",
)
METHOD: dict[str, Any] = {**dict.fromkeys((*WHO, "effects", "discovery"), True), "plant": {"effects", "cell"}}
"""Keys of a scenario that say who runs, with what model, and how it is told, not what is asked; what constants and
effects the plant has is taken from its model."""


def conditions(scenario: Scenario) -> str:
    """Twelve hexadecimal digits over plant, cell, inputs, drift, measurements, limits, prices and accounted time.

    Estimators, controllers, their options and their model do not enter: a copy of a scenario with another option
    compares with the original. Nor do keys at their default: a later version may add a key, and old results still
    compare with new ones.
    """
    asked = scenario.file.model_dump(mode="json", exclude=METHOD, exclude_defaults=True)
    asked["starts_after"], asked["accounted_after"] = scenario.initial_rows, scenario.fits_after
    plant = scenario.plant_model
    asked["cell"] = dict(zip(plant.names("parameters"), plant.parameter_values.tolist(), strict=True))
    if plant.effects:
        asked["effects"] = [effect.as_dict() for effect in plant.effects]
    if not asked.get("plant"):
        asked.pop("plant", None)
    if is_model_file(asked.get("model", "")):  # then two spellings may mean one process
        del asked["model"]
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:12]
