"""The answer to a record: what is hidden in it, which verdicts are right, and what there is to gain."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from benchmarks.hidden_effects.effects.catalogue import equivalents
from benchmarks.hidden_effects.effects.curves import onset_of
from benchmarks.hidden_effects.effects.spec import Spec

VERDICTS = ("none", "named", "class", "unnamed", "insufficient", "abstain")


@dataclass(frozen=True)
class Hidden:
    """One hidden effect as the answer tells it; `accepted` are other names of the same thing, each with the reason."""

    site: str
    driver: str
    shape: str
    amplitude: float
    parameters: dict[str, Any]
    onset_s: float | None
    story: str
    scale: dict[str, float]  # of the driver and the amplitude, as `spec.Spec` has them
    size: dict[str, float]  # removable, noise standard deviations rms, an output
    accepted: list[dict[str, str]]

    @staticmethod
    def of(spec: Spec, size: dict[str, float]) -> Hidden:
        """Answer of a spec whose size was measured."""
        onset = onset_of(spec.shape, spec.parameters) if spec.driver == "time" else None
        scale = {"low": spec.low, "high": spec.high, "centre": spec.centre, "unit": spec.unit}
        what = (spec.site, spec.driver, spec.shape, spec.amplitude, dict(spec.parameters))
        same = equivalents(spec.site, spec.driver, spec.shape)
        return Hidden(*what, onset, spec.story, scale, size, same)


def spec_of(hidden: dict[str, Any]) -> Spec:
    """The effect of an answer read back, for an oracle."""
    return Spec(
        hidden["site"], hidden["driver"], hidden["shape"], hidden["amplitude"], hidden["parameters"], **hidden["scale"]
    )


@dataclass(frozen=True)
class GroundTruth:
    """Everything a score needs. `site` and `driver` list every right name, as the hand-made examples do."""

    record: str
    category: str  # single, none, drift, pair, beyond, unexcited, fault
    verdict: str  # the verdict that is expected first
    right_verdicts: list[str]  # verdicts that need no name to be right
    effects: list[Hidden]
    tolerated: list[dict[str, str]]  # names that are no right answer and no wrong one; driver "*" is any
    ordinary: bool  # one effect of 5 to 50 noise standard deviations
    loop: str
    noise: dict[str, Any]
    seed: list[int]
    rows: int
    n: float
    C: float
    start: list[float]  # nominal core state before the first row
    drift: list[dict[str, Any]] = field(default_factory=list)
    note: str = ""
    size: dict[str, float] = field(default_factory=dict)  # of everything together
    absorbed: dict[str, float] = field(default_factory=dict)  # what n and C would move by
    base_error: dict[str, dict[str, float]] = field(default_factory=dict)  # output -> fit, report; rms in its unit
    oracle_error: dict[str, dict[str, float]] = field(default_factory=dict)
    squares: dict[str, dict[str, list[float]]] = field(default_factory=dict)  # output -> base, oracle, rows; see record

    def as_dict(self) -> dict[str, Any]:
        """As written to JSON."""
        names = [(e.site, e.driver) for e in self.effects]
        names += [(a["site"], a["driver"]) for e in self.effects for a in e.accepted]
        content = asdict(self)
        content["site"] = sorted({site for site, _ in names})
        content["driver"] = sorted({driver for _, driver in names})
        return content
