"""What is certain among explanations of two effects, told by itself.

A model that lacks something on its reference has it in the new record too, and a second effect takes that up. It says
nothing of what has changed; which one it is stays open. What is certain beside it may be told alone, where it explains
more than any other effect does alone. Whether errors fall to those of the reference then is judged by `with_cause`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from adaptive_flot.discovery.hypotheses.families import STRUCTURE
from adaptive_flot.discovery.innovations.late import late_anywhere
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results.words import WITH_A_NAME


def sole_cause(search: Search, base: Explanation, found: Sequence[Explanation], told: Told) -> Told | None:
    """The one certain effect of explanations of two, with its own explanation; None where there is none.

    Parameters
    ----------
    search, base
        The search in the new record, and the model as it is there.
    found
        All explanations, the best first.
    told
        What was judged.
    """
    beside = told.open or len(told.best.hypotheses) > 1
    if told.word not in WITH_A_NAME or not beside or len(told.certain) != 1:
        return None
    (effect,) = told.certain
    alone = [e for e in found if len(e.hypotheses) == 1]
    if not alone or effect.kind in STRUCTURE or alone[0].hypotheses[0].label != effect.label:
        return None
    first, *others = alone
    if not all(told_apart(search, base, first, e) for e in others if e.hypotheses[0].site != effect.site):
        return None
    named = replace(told, word="named", best=first, certain=first.hypotheses, open=(), alike=(first,))
    return late_anywhere(search, base, named)
