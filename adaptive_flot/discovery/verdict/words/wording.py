"""The verdict in plain words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Alternative, Judgement, NamedEffect, SearchResult
from adaptive_flot.discovery.results.words import NO_SITE
from adaptive_flot.discovery.verdict.judge import leads_by_far, same_signal, same_site
from adaptive_flot.discovery.verdict.words.sizes import spaced, words_alone, words_each
from adaptive_flot.greybox.forms.form import CoefficientRole

LACKS_THIS, LACKS_THESE = "The model lacks this.", "The model lacks these effects."
LACKS_ONE, LACKS_SEVERAL = "The model lacks one", "The model lacks several effects."
HAS_CHANGED = "This has changed since the reference."


def drift_words(judgement: Judgement, after: Fit) -> tuple[str, ...]:
    """What drifts and by how much, for each effect of a drift."""
    assert judgement.best is not None  # drift is a kind of alternative
    said = []
    for effect in after.model.fitted_effects()[-len(judgement.best.names) :]:
        values = effect.levels
        change = values[0] if len(values) == 1 else _largest_move(values)
        site = next(s for s in after.model.sites if s.name == effect.site)
        offset = (effect.mode or site.mode) == "offset"
        size = f"{change:+.3g} {site.unit or ''}".rstrip() if offset else f"{100 * (np.exp(change) - 1):+.0f} %"
        said.append(f"{effect.site} changes by about {size} ({effect.form} in time)")
    return tuple(said)


def _largest_move(values: list[float]) -> float:
    """Difference of the extremes of a profile, negative where the larger comes first."""
    high, low = int(np.argmax(values)), int(np.argmin(values))
    return (values[high] - values[low]) * (1 if high > low else -1)


def since_reference(reason: str, new: bool) -> str:
    """A reason about a model whose reference has said what it lacks: it has changed, where that is known to be new."""
    if new:
        told = HAS_CHANGED, "These have changed since the reference."
        several = "One", "Several things have changed since the reference."
    else:
        told = ("The reference does not show whether it was there.",) * 2
        several = "It is one", "It is several effects."
    for lacks, said in zip((LACKS_THIS, LACKS_THESE, LACKS_ONE, LACKS_SEVERAL), (*told, *several), strict=True):
        reason = reason.replace(lacks, said)
    return reason


def reason_words(
    judgement: Judgement,
    result: SearchResult,
    effects: tuple[NamedEffect, ...],
    drift: tuple[str, ...],
    contradiction: str = "",
    wrong: Sequence[str] = (),
    said: str = "",
) -> str:
    """The verdict in one paragraph; what contradicts a name comes first.

    `said` is what is told in the words of its user. Where outputs stay `wrong` after all, what every set has is what
    they share, and not certain.
    """
    if contradiction and judgement.best is not None:
        fitted = " with ".join(f"{site} by {driver}" for site, driver in judgement.best.names)
        return (
            f"Something is missing, but it is not told: {fitted} fits the record best, and {contradiction}. "
            "Look for what else happened in the record."
        )
    if judgement.word == "none" and drift:
        said = "; ".join(drift).replace("_", " ")
        return (
            f"{said[:1].upper()}{said[1:]}. This slow change of what is fitted explains the residual, and no other "
            "effect shows. Where it should not change, look there for the cause. Else tracking it is the estimator's "
            "work."
        )
    if judgement.word == "none":
        return (
            "The model explains the record: no effect that was tried, at any site, with any driver, removes more of "
            "the residual than noise would, or what it removes does not stand on rows that did not choose it."
        )
    if not result.rounds[0].compared:
        best = judgement.best
        so_far = " with ".join(f"{s} by {d}" for s, d in best.names) if best else ""
        ahead = f", whatever is ahead by now ({so_far})" if so_far else ""
        return f"The time for the search ended before the rivals had been compared: nothing is found yet{ahead}."
    if judgement.word == "abstain" and judgement.best is None:
        return "Something is missing, and no effect that was tried explains it, at any site, with any driver."
    evidence = f"{result.verification}" if result.verification else ""
    evidence = evidence[:1].upper() + evidence[1:]
    if judgement.word == "named":
        lacks = LACKS_THESE if len(effects) > 1 else LACKS_THIS
        return f"{said}. {lacks} {beside_a_part(judgement)}{evidence}.{_still_wrong(wrong)}"
    if judgement.word == "class":
        return f"{_class_words(judgement, wrong)} {evidence}."
    if judgement.word == "unnamed":
        evidence = f"{beside_a_part(judgement)}{evidence}.{_still_wrong(wrong)}"
        return f"{said}. The model lacks this, and it has no name. {evidence}"
    best = judgement.best
    if best and leads_by_far(result, judgement):
        others = ", ".join("+".join(_brief(a)) for a in judgement.rivals[:3])
        return (
            f"Something is missing. {' with '.join(_brief(best))} fits the record best by far, and is not told: it "
            f"leaves more than its lead over others ({others}), so that a further cause may turn that over. {evidence}."
        )
    close = ", ".join("+".join(_brief(a)) for a in (judgement.best, *judgement.rivals[:3]) if a)
    return (
        "Something is missing, but the record does not say what: too many alternatives explain it about as well, or "
        f"none explains it well ({close}). {evidence}."
    )


def _still_wrong(wrong: Sequence[str]) -> str:
    """A sentence on the outputs whose errors stay far above their noise with what is told; empty for none."""
    return f" Still far above the noise: {', '.join(map(spaced, wrong))}." if wrong else ""


def still_wrong_or_wandering(wrong: Sequence[str]) -> str:
    """The same for a free run beside process noise, whose error what wanders makes larger; empty for none."""
    said = ", ".join(map(spaced, wrong))
    return f"Still far above the noise, by what wanders or by a further cause: {said}." if wrong else ""


def beside_words(likelihood: float, smaller: bool = False) -> str:
    """Why a name is told although no error on held-out rows is surely smaller; empty without a `likelihood`."""
    if not likelihood:
        return ""
    times = f"e^{likelihood / 2:.0f}"
    if smaller:
        return (
            "The error on held-out rows is smaller, but its interval reaches zero: the course of a feed is most of it. "
            f"Those rows are likelier with the effect by a factor of {times}."
        )
    return (
        "The error on held-out rows stays as it is: several other constants, each a little off, would do there what "
        f"this one does. Those rows make that less likely by a factor of {times}."
    )


def _class_words(judgement: Judgement, wrong: Sequence[str]) -> str:
    assert judgement.best is not None  # a class has a best member
    sets = [a for a in (judgement.best, *judgement.rivals) if judgement.near(a)]
    if judgement.part or all(len(a.names) == 1 for a in sets):
        alone = {a.names[0]: words_alone(a) for a in reversed(sets) if len(a.names) == 1}
        each = [alone.get(name) or _of_name(*name) for name in judgement.members]
        if judgement.beside:
            each[-1] = f"as if {judgement.beside}, and {NO_SITE}"
        members = "; or ".join(each)
        said = f"{LACKS_ONE} of these, which this record can not tell apart: {members}."
        further, places = [name for name in alone if name not in judgement.members], {s for s, _ in judgement.members}
        if alike := ", ".join(" by ".join(name) for name in further if name[0] in places):
            said += f" At the same places it may as well be: {alike}."
        if nameless := ", ".join(" by ".join(name) for name in further if name[0] not in places):
            said += f" As near, but without a known reason: {nameless}."
        return f"{said} {beside_a_part(judgement)}".rstrip()
    shared = [n for n in judgement.best.names if all(n in a.names for a in sets)]
    either = same_site(shared)
    both = same_signal([n for n in shared if n not in either])
    words = [LACKS_SEVERAL]
    if sure := [name for name in shared if name not in (*either, *both)]:
        if wrong:
            has = ", ".join(" by ".join(name) for name in sure)
            words.append(f"All that come near have {has}; still wrong: {', '.join(wrong)}.")
        else:
            fitted = words_each(judgement.best)
            words.append(f"Certain: {'; '.join(fitted.get(name, _of_name(*name)) for name in sure)}.")
    for site in dict.fromkeys(s for s, _ in either):
        drivers = " or ".join(d for s, d in either if s == site)
        words.append(f"{site} depends on {drivers}, or on both: one dependence of another shape would look the same.")
    for driver in dict.fromkeys(d for _, d in both):
        sites = " or ".join(s for s, d in both if d == driver)
        words.append(f"{sites} depends on {driver}, or both: one of them, of another shape, would look the same.")
    rest = [" with ".join(f"{s} by {d}" for s, d in a.names if (s, d) not in shared) for a in sets]
    if any(rest):
        listed = "; ".join(r or "nothing more" for r in rest)
        words.append(f"This record can not tell these apart, of which the first is kept: {listed}.")
    return " ".join(words)


def _brief(a: Alternative) -> list[str]:
    """Each effect of an alternative in a few words: `valve by lag (sticks)`."""
    sticks = {(e.site, e.driver) for e in a.effects if e.names(CoefficientRole.BAND) and e.family.has_memory}
    return [f"{s} by {d}{' (sticks)' if (s, d) in sticks else ''}" for s, d in a.names]


def _of_name(site: str, driver: str) -> str:
    """A member of a class that has no fit of its own, in words."""
    return f"{spaced(site)} gives another amount than is asked" if driver == "own_value" else f"{site} by {driver}"


def beside_a_part(judgement: Judgement) -> str:
    """What stands beside a part that is certain, in a sentence; empty where the whole is told."""
    if judgement.best is None or not judgement.part:
        return ""
    told = {*judgement.part, *judgement.members}
    sets = [judgement.best, *(a for a in judgement.rivals if judgement.near(a))]
    rests = dict.fromkeys(" with ".join(f"{s} by {d}" for s, d in a.names if (s, d) not in told) for a in sets)
    listed = "; or ".join(r for r in rests if r)
    return f"Something else is off beside it, which this record does not tell{f': {listed}' if listed else ''}. "
