"""A part of a YAML file that somebody wrote, as pydantic checks it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Part(BaseModel):
    """Keys of one level: an unknown key, an infinite number and a later change are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
