"""What discovery found beside a link: what a person is shown, and what would be added to the model."""

from __future__ import annotations

from dataclasses import dataclass

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray


@dataclass(frozen=True, eq=False)
class Finding:
    """What discovery found.

    Attributes
    ----------
    word
        The verdict in one word.
    reason
        It in a paragraph.
    evidence
        What speaks for it, one line each.
    errors
        (output, unit, error before, error after) on rows that chose nothing.
    effects
        What would be added to the model; empty where nothing is to be done.
    parameters
        Adapted parameters, by full name, that were fitted with it.
    begin
        Time of the first row of the record that was searched [s].
    initial_state
        State of the extended model then, fitted with it (nx,); None where none was.
    """

    word: str
    reason: str
    evidence: tuple[str, ...] = ()
    errors: tuple[tuple[str, str, float, float], ...] = ()
    effects: tuple[Effect, ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    begin: float = 0.0
    initial_state: FloatArray | None = None

    def __str__(self) -> str:
        return f"{self.word}: {self.reason}"
