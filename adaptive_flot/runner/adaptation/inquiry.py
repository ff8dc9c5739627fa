"""What came of one alarm: when, what was searched, what was found, and whether it was taken up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # pages that tell of no search need no discovery
    from adaptive_flot.discovery.results import Verdict


@dataclass(frozen=True)
class Inquiry:
    """One alarm and the search that followed.

    Attributes
    ----------
    alarm_s
        End of the window that raised it [s].
    p_values
        p value of each test that was rejected, by output and test.
    record_s
        Ends of the record that was searched [s]; the second one is when the search started.
    judged_s
        When its result was taken up, or not [s].
    verdict
        The verdict; None where the search failed.
    extended
        Whether the model of estimator and controller was extended.
    why
        Why not, or what failed, in words; empty where it was extended.
    errors
        Root mean square one-step error of each watched output over the rows between search and result, which
        did not enter the search: (before, after the extension), in the output's unit. Empty without an extension.
    """

    alarm_s: float
    p_values: Mapping[str, float]
    record_s: tuple[float, float]
    judged_s: float
    verdict: Verdict | None = None
    extended: bool = False
    why: str = ""
    errors: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Entry of the JSON summary."""
        return {
            "alarm_s": self.alarm_s,
            "p_values": dict(self.p_values),
            "record_s": list(self.record_s),
            "judged_s": self.judged_s,
            "extended": self.extended,
            "why": self.why,
            "one_step_error": {k: {"before": b, "after": a} for k, (b, a) in self.errors.items()},
            "verdict": None if self.verdict is None else self.verdict.as_dict(),
        }
