"""What the plant does: twelve truths, each a shipped scenario with some of its entries replaced."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from adaptive_flot.processes.flotation.cell_file import default_cell, save_cell
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.scenario.loading import find_scenario, load_scenario
from adaptive_flot.runner.scenario.scenario import Scenario

PAPER, WALK = "paper_scenario_1", "random_walk"
FEED_GRADE = "feed_concentration.chalcopyrite"


@dataclass(frozen=True)
class Truth:
    """One row of the table.

    Attributes
    ----------
    words
        What it is.
    edits
        Entries of the scenario that it replaces, by key.
    constants
        Constants of the plant as multiples of those of the model, by name.
    base
        Shipped scenario.
    """

    words: str
    edits: Mapping[str, Any] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    base: str = PAPER

    @property
    def has_true_parameters(self) -> bool:
        """Whether the adapted parameters have true values in the model, the other constants being what they are."""
        return not self.constants

    def scenario(self, folder: Path, key: str) -> Scenario:
        """The scenario, written into a folder and read."""
        content = yaml.safe_load(find_scenario(self.base).read_text(encoding="utf-8"))
        content = {**content, "description": self.words, **self.edits}
        content.pop("published", None)
        if self.constants:
            cell = default_cell()
            values = {name: factor * cell.value(name) for name, factor in self.constants.items()}
            save_cell(cell_file(), values, "benchmark: other than the model's", folder / f"{key}_cell.yaml")
            content["plant"] = {"cell": f"{key}_cell.yaml"}
        path = folder / f"{key}.yaml"
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return load_scenario(path)


def ramp(change: float, start: float, end: float) -> dict[str, Any]:
    """A ramp by a share of the parameter from one time to another [s]."""
    return {"profile": "ramp", "change": change, "from_s": start, "to_s": end}


def sine(share: float, period: float, start: float = 600.0, end: float = 2400.0, every: float = 10.0) -> dict[str, Any]:
    """A sine about the nominal value from `start` on, held for `every` [s]."""
    times = np.arange(start, end, every)
    factors = 1 + share * np.sin(2 * np.pi * (times - start) / period)
    return {"profile": "factors", "at_s": [0.0, *times.tolist()], "factors": [1.0, *factors.tolist()]}


ONE_BY_ONE = {"C": ramp(0.2, 600, 1200), "n": ramp(0.2, 1200, 1800)}
FEED_STEPS = {"profile": "factors", "at_s": [0, 900, 1400, 1900], "factors": [1.0, 1.2, 0.8, 1.0]}

TRUTHS: Mapping[str, Truth] = {
    "paper": Truth("the paper's"),
    "both_ramp": Truth("both ramp", {"parameters": {"C": ramp(0.2, 600, 1800), "n": ramp(0.2, 600, 1800)}}),
    "opposite_ramps": Truth("opposite ramps", {"parameters": {"C": ramp(0.2, 600, 1800), "n": ramp(-0.2, 600, 1800)}}),
    "sines": Truth("sines, held for 10 s", {"parameters": {"C": sine(0.1, 900), "n": sine(0.1, 600)}}),
    "smooth_sines": Truth(
        "sines, a new value each second",
        {"parameters": {"C": sine(0.1, 900, every=1.0), "n": sine(0.1, 600, every=1.0)}},
    ),
    "ramps_down": Truth("ramps down", {"parameters": {"C": ramp(-0.2, 600, 1200), "n": ramp(-0.2, 1200, 1800)}}),
    "outliers": Truth(
        "outliers: 5 % are off by 20 standard deviations",
        {"faults": [{"fault": "outliers", "output": "concentrate_grade", "rate": 0.05, "size": 0.02}]},
    ),
    "assays": Truth(
        "assay every 60 s", {"measurements": {"concentrate_grade": {"noise_std": 1.0e-3, "every_s": 60.0}}}
    ),
    "walk": Truth("random walk", base=WALK),
    "burst_1_percent": Truth("burst constant 1 % off", constants={"burst_b": 1.01}),
    "feed_grade": Truth(
        "feed grade not known",
        {"parameters": {**ONE_BY_ONE, FEED_GRADE: FEED_STEPS}, "disturbances": {FEED_GRADE: {"measured": False}}},
    ),
    "five_constants": Truth(
        "five constants 20 % off",
        constants={
            "burst_b": 0.8,
            "drag_coefficient": 1.2,
            "peclet": 0.8,
            "floatability.chalcopyrite": 0.8,
            "floatability.quartz": 1.2,
        },
    ),
}
