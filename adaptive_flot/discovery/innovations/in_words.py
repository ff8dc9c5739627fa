"""What the innovations form tells, in words."""

from __future__ import annotations

from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.discovery.innovations.told import Told
from adaptive_flot.discovery.results import NamedEffect
from adaptive_flot.discovery.results.words import NO_SITE
from adaptive_flot.discovery.verdict.words.sizes import words_of_effect


def told_in_words(search: Search, told: Told) -> str:
    """What is certain, then what is one of a few."""
    sure = "; and ".join(words_at(search, told.best, h) for h in told.certain)
    said = f"{sure[0].upper()}{sure[1:]}." if sure else ""
    if told.word == "named" and told.beside:
        return (
            f"One of these, which the record can not tell apart: {sure}; or as if {told.beside.words}, and {NO_SITE}."
        )
    if told.word != "class":
        return said
    together: dict[int, list[str]] = {}  # what one explanation has of the class acts at once
    for e, h in told.open:
        together.setdefault(id(e), []).append(_open_one(search, told, e, h))
    members = "; or ".join(", and ".join(words) for words in together.values())
    members += f"; or as if {told.beside.words}, and {NO_SITE}" if told.beside and not sure else ""
    first = "Besides, one of these" if sure else "One of these"
    return f"{said} {first}, which the record can not tell apart: {members}.".strip()


def _open_one(search: Search, told: Told, explanation: Explanation, h: Hypothesis) -> str:
    """One of a class, with the store that its explanation has beside it."""
    stores = [k for k in explanation.hypotheses if k.kind == "store" and k is not h and k not in told.certain]
    return ", and ".join(words_at(search, explanation, k) for k in (h, *stores))


def words_at(search: Search, explanation: Explanation, h: Hypothesis) -> str:
    """One effect of an explanation, with its fitted size."""
    model = search.model_of(explanation)
    if h.kind == "alternative":  # of the free run, in its words
        effect = next(e for e in model.fitted_effects() if e.label == h.effect.label)
        return words_of_effect(model, NamedEffect(effect, "", {}, ()))
    return words_of(model, h, lambda name: model.parameters[model.index("parameters", name)].value)
