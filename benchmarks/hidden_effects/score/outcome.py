"""One verdict against one answer.

| outcome       | what was said                                                                          |
|---------------|----------------------------------------------------------------------------------------|
| right         | the right name; `none` where nothing is hidden; what else the answer calls right         |
| right_class   | the truth is in a class of at most three                                                |
| right_place   | unnamed, with the right site and driver                                                 |
| part          | one of two effects named, none wrong                                                    |
| tolerated     | neither right nor wrong: a drift called an effect on n or C over time, a failing sensor |
| vague         | a class with the truth, but of more than three; unnamed at another place                |
| abstained     | `insufficient` or `abstain` where there was more to say; a command that refused (exit 2) |
| missed        | `none` where an effect is                                                               |
| wrong_class   | a class without the truth                                                               |
| wrong_name    | a name that is not the truth                                                            |
| false_alarm   | an effect where none is                                                                 |
| failed        | crash, no verdict, malformed verdict                                                    |
| timeout       | no verdict in time                                                                      |
"""

from __future__ import annotations

from typing import Any

from benchmarks.hidden_effects.score.verdict import SubmittedVerdict

OUTCOMES = (
    "right",
    "right_class",
    "right_place",
    "part",
    "tolerated",
    "vague",
    "abstained",
    "missed",
    "wrong_class",
    "wrong_name",
    "false_alarm",
    "failed",
    "timeout",
)
LARGEST_CLASS = 3
VISIBLE = 2.0  # noise standard deviations: an unexcited effect below it is no effect in this record
Pair = tuple[str, str]
Answer = dict[str, Any]


def has_effect(answer: Answer) -> bool:
    """Whether there is anything to find in a record (drift of n and C, which the model adapts to, is not)."""
    category = answer["category"]
    if category == "unexcited":
        return max(answer["size"].values(), default=0.0) >= VISIBLE
    return category in ("single", "pair", "beyond")


def classify(answer: Answer, verdict: SubmittedVerdict) -> str:
    """Outcome of a verdict."""
    if verdict.verdict in ("insufficient", "abstain"):
        return "right" if verdict.verdict in answer["right_verdicts"] else "abstained"
    if verdict.verdict == "none":
        quiet = "none" in answer["right_verdicts"] or not has_effect(answer)
        return "right" if quiet else "missed"
    said = [name.pair() for name in (verdict.members if verdict.verdict == "class" else verdict.effects)]
    if verdict.verdict == "unnamed":
        return _unnamed(answer, said)
    if not answer["effects"]:
        return _without_names(answer, said, verdict.verdict)
    return _class(answer, said) if verdict.verdict == "class" else _named(answer, said)


def effects_told(answer: Answer, verdict: SubmittedVerdict) -> int:
    """How many of the hidden effects are told: a right name of each among those given, at most three an effect.

    None where one of several names that are said for sure is wrong.
    """
    said = {n.pair() for n in (verdict.members if verdict.verdict == "class" else verdict.effects)}
    told = sum(bool(right_names(effect) & said) for effect in answer["effects"])
    if verdict.verdict == "named":
        return 0 if _named(answer, list(said)) == "wrong_name" else told
    few = len(said) <= LARGEST_CLASS * len(answer["effects"])
    return told if few and verdict.verdict in ("class", "unnamed") else 0


def right_names(effect: dict[str, Any]) -> set[Pair]:
    """Every name of one hidden effect."""
    return {(effect["site"], effect["driver"]), *((a["site"], a["driver"]) for a in effect["accepted"])}


def _tolerated(answer: Answer, pair: Pair) -> bool:
    return any(t["site"] == pair[0] and t["driver"] in ("*", pair[1]) for t in answer["tolerated"])


def _named(answer: Answer, said: list[Pair]) -> str:
    names = [right_names(effect) for effect in answer["effects"]]
    if not said or any(not any(pair in right for right in names) for pair in said):
        return "wrong_name" if said else "failed"
    return "right" if all(right & set(said) for right in names) else "part"


def _class(answer: Answer, said: list[Pair]) -> str:
    if not any(right_names(effect) & set(said) for effect in answer["effects"]):
        return "wrong_class"
    return "right_class" if len(set(said)) <= LARGEST_CLASS else "vague"


def _unnamed(answer: Answer, said: list[Pair]) -> str:
    if "unnamed" in answer["right_verdicts"]:
        return "right"
    if not has_effect(answer):
        return "tolerated" if said and all(_tolerated(answer, pair) for pair in said) else "false_alarm"
    names = set().union(*(right_names(effect) for effect in answer["effects"]))
    return "right_place" if said and set(said) <= names else "vague"


def _without_names(answer: Answer, said: list[Pair], kind: str) -> str:
    """A name or class where the answer has none: controls, effects out of the catalogue, unexcited ones."""
    fits = [_tolerated(answer, pair) for pair in said]
    if fits and (all(fits) if kind == "named" else any(fits)):
        return "tolerated"
    if not has_effect(answer):
        return "false_alarm"
    return "wrong_name" if kind == "named" else "wrong_class"
