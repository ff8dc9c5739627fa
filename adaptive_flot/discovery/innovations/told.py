"""What the innovations form says, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.judgement import WithoutSite
from adaptive_flot.discovery.innovations.search.explanation import Explanation

Word = Literal["none", "named", "class", "abstain"]


@dataclass(frozen=True)
class Told:
    """What the innovations form says.

    Attributes
    ----------
    word
        `none`, `named`, `class` or `abstain`.
    best
        The best explanation; of a name, with what is certain and nothing else.
    certain
        Its effects that every explanation about as good has, too.
    open
        Effects of a class, one a site, the best one's first.
    alike
        Explanations that the record does not tell from the best one, this one first.
    why
        What decided, in words, where nothing is told.
    beside
        What explains about as much as a name where the model has no site; None where nothing does.
    """

    word: Word
    best: Explanation
    certain: tuple[Hypothesis, ...]
    open: tuple[tuple[Explanation, Hypothesis], ...]
    alike: tuple[Explanation, ...]
    why: str
    beside: WithoutSite | None = None

    @property
    def effects(self) -> tuple[Hypothesis, ...]:
        """What is certain, then what is one of a few."""
        return (*self.certain, *(h for _, h in self.open))

    @property
    def sites(self) -> frozenset[str]:
        """Sites of every effect of the explanations that are not told apart."""
        return frozenset(h.site for e in self.alike for h in e.hypotheses)
