"""The key `discovery` of a scenario: who is watched, how closely, and what is done when a model falls short."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

FEWEST = 50
"""Innovations of an output that a window must hold to be tested."""


class DiscoveryOptions(BaseModel):
    """Watching innovations, and searching for what the model lacks where they are not white.

    The defaults are for samples every second; times are in simulated seconds.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    estimators: list[str] | None = Field(default=None, min_length=1)
    """Names of the scenario's estimators that are watched; default all that are not shown the truth."""
    outputs: list[str] | None = Field(default=None, min_length=1)
    """Outputs whose innovations are watched; default those that drive the adaptation. No estimator corrects others, so
    that their innovations also carry what the input measurements are off by."""
    window_s: float = Field(default=300.0, gt=0)
    """Length of the windows that are tested, one after the other [s]."""
    false_alarm: float = Field(default=1e-3, gt=0, lt=0.5)
    """Share of the windows of white innovations that raise an alarm, all outputs and tests together."""
    least_record_s: float = Field(default=1200.0, gt=0)
    """Shortest record that is searched; an alarm before that waits [s]."""
    record_s: float = Field(default=3600.0, gt=0)
    """Longest record that is searched, back from the alarm [s]."""
    delay_s: float = Field(default=300.0, gt=0)
    """Time from the start of a search to its result. In simulation the result is taken up then, however fast the
    machine is; a search that is not ready is waited for [s]."""
    pause_s: float = Field(default=600.0, ge=0)
    """Time after a result that changed nothing until an alarm starts the next search [s]."""
    most_effects: int = Field(default=3, ge=1)
    """Extensions of the model in one run."""
    processes: int = Field(default=1, ge=1)
    """Processes of a search."""
