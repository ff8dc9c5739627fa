"""The verdict a discover command writes (`--json`), as far as a score needs it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class Name(BaseModel):
    """A site and what acts on it."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=True)
    site: str
    driver: str

    def pair(self) -> tuple[str, str]:
        """As a pair."""
        return self.site, self.driver


class ErrorBlock(BaseModel):
    """Error of one output before and after, on data not used for choosing."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=True)
    before: float | None = None
    after: float | None = None


class SubmittedVerdict(BaseModel):
    """What was found."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=True)
    verdict: Literal["none", "named", "class", "unnamed", "insufficient", "abstain"]
    effects: list[Name] = Field(default_factory=list)
    members: list[Name] = Field(default_factory=list, alias="class")
    error: dict[str, ErrorBlock] = Field(default_factory=dict)
    report_times_s: list[tuple[float, float]] = Field(default_factory=list)  # first and last time of each held-out part
    seconds: float | None = None


def read_verdict(file: Path) -> SubmittedVerdict | str:
    """The verdict in a file, or one line on why there is none."""
    try:
        content: Any = json.loads(file.read_text())
    except OSError:
        return "no verdict written"
    except ValueError as error:
        return f"not JSON: {error}"
    try:
        return SubmittedVerdict.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        return f"not a verdict: {'.'.join(map(str, first['loc']))}: {first['msg']}"
