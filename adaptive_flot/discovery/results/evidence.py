"""What tests of a residual, comparisons of fits and first-order scores have shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from adaptive_flot.discovery.results.words import short


@dataclass(frozen=True)
class Symptom:
    """What one output shows.

    Attributes
    ----------
    output
        Its name.
    size
        Root mean square of the residual over the noise seen from row to row; 1 when nothing is missing.
    white
        p value of whiteness (Ljung-Box, of the residual itself).
    inputs
        p value of independence of the past of each input, by name; of the whitened residual.
    follows
        Inputs of which it is not independent.
    onset_s
        Time at which the mean of the residual changes most; None when it does not (moving sums of the residual itself).
    shows
        Whether any of the tests rejects; by Holm's procedure over all tests of all outputs, as `follows` and `onset_s`.
    """

    output: str
    size: float
    white: float
    inputs: dict[str, float]
    follows: tuple[str, ...]
    onset_s: float | None
    shows: bool

    def __str__(self) -> str:
        if not self.shows:
            return f"{self.output}: nothing beyond noise (residual {self.size:.2f} x the noise)"
        said = f"{self.output}: residual {self.size:.1f} x the noise"
        said += f", follows {', '.join(self.follows)}" if self.follows else ""
        return said + (f", which changes most at about {self.onset_s:.0f} s" if self.onset_s is not None else "")


@dataclass(frozen=True)
class Detection:
    """What the outputs show together."""

    symptoms: tuple[Symptom, ...]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs in which something is missing."""
        return tuple(s.output for s in self.symptoms if s.shows)

    def __str__(self) -> str:
        return "\n".join(map(str, self.symptoms))

    def as_dict(self) -> list[dict[str, Any]]:
        """Entry of the machine-readable verdict."""
        return [
            {
                "output": s.output,
                "shows": s.shows,
                "residual_over_noise": s.size,
                "ljung_box": s.white,
                "independence": s.inputs,
                "follows": list(s.follows),
                "onset_s": s.onset_s,
            }
            for s in self.symptoms
        ]


@dataclass(frozen=True)
class Place:
    """A kind of place or cause, its best candidate, and the share of the best gain of all that this has."""

    kind: str
    site: str
    driver: str
    share: float


@dataclass(frozen=True)
class Location:
    """Places and causes by what the best candidate of each would explain, best first, and the outputs that show it."""

    outputs: tuple[str, ...]
    places: tuple[Place, ...]
    causes: tuple[Place, ...]

    def __str__(self) -> str:
        where = ", ".join(f"{p.kind} {100 * p.share:.0f} %" for p in self.places)
        when = ", ".join(f"{p.kind} {100 * p.share:.0f} %" for p in self.causes)
        return f"shows in {', '.join(self.outputs) or 'no output'}; to first order: {where}; {when}"

    def as_dict(self) -> dict[str, Any]:
        """Entry of the machine-readable verdict."""

        def rows(places: tuple[Place, ...]) -> list[dict[str, Any]]:
            return [{"kind": p.kind, "site": p.site, "driver": p.driver, "share": round(p.share, 3)} for p in places]

        return {"outputs": list(self.outputs), "places": rows(self.places), "causes": rows(self.causes)}


RUNS_AWAY = 1e6
"""Times the noise from which an error is no number to compare: the free run has left all bounds."""


@dataclass(frozen=True)
class OutputChange:
    """Free-run error of one output on one split: before, after, its noise, and a 95 % interval of the reduction."""

    output: str
    unit: str
    before: float
    after: float
    noise: float
    reduction95: tuple[float, float]

    def __str__(self) -> str:
        low, high = (100 * r for r in self.reduction95)
        return (
            f"{self.output}: {short(self.before)} -> {short(self.after)} {self.unit} "
            f"(noise {short(self.noise)}; reduction {low:.0f} to {high:.0f} %)"
        )

    @property
    def words(self) -> str:
        """Output and errors before and after, once where they are the same, without a unit where there is none."""
        changed = "" if self.after == self.before else f" -> {self.size(self.after, short(self.after))}"
        return f"{self.output} {self.size(self.before, short(self.before))}{changed} {self.unit}".rstrip(" -")

    def size(self, error: float, number: str) -> str:
        """One of the two errors: its number, or that the run leaves all bounds, as one that empties a tank may do."""
        return number if error < RUNS_AWAY * max(self.noise, 1e-300) else "runs away"


@dataclass(frozen=True)
class Verification:
    """Whether an alternative stands on rows to which it was not fitted.

    Attributes
    ----------
    reduction, reduction95
        Drop of the root mean square error over all outputs, in units of their noise, and its 95 % interval.
    worse
        Outputs whose error grew.
    confirmed
        Interval above zero and no output worse.
    where
        The rows it was measured on, in words.
    likelihood
        Drop of minus two log-likelihood on these rows beside a background that was not fitted to them, where that
        confirms; zero else.
    """

    reduction: float
    reduction95: tuple[float, float]
    worse: tuple[str, ...]
    confirmed: bool
    where: str = "on the confirm split"
    likelihood: float = 0.0

    def __str__(self) -> str:
        low, high = (100 * r for r in self.reduction95)
        word = "confirmed" if self.confirmed else "not confirmed"
        if self.confirmed and not low > 0:
            times = f"{self.likelihood / 2:.0f}"
            return f"confirmed: constants that are off instead are less likely by a factor of e^{times} {self.where}"
        return f"{word}: error {100 * self.reduction:.0f} % smaller ({low:.0f} to {high:.0f} %) {self.where}"
