"""An event at a site, beside one that acts on the balance of a state and that no site of the model stands for.

A probe that shows 15 % less for an hour, and fresh water that nobody measures, look alike to a model that has a site
for the first alone. Their edges differ: what a sensor shows changes at once, and a basin takes its time. So before an
event is told, an amount of its own is put into the balance of each state in turn. Where one of these explains the
record better, the model has no place for what has happened.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from adaptive_flot.discovery.hypotheses.families import EVENTS, FOREVER, Hypothesis
from adaptive_flot.discovery.innovations.judge import Told
from adaptive_flot.discovery.innovations.screening import Screened, Screening
from adaptive_flot.discovery.innovations.search import Explanation, Search
from adaptive_flot.discovery.innovations.telling_apart import told_apart
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.scope import Scope, Site

BALANCE = "balance of "


@dataclass(frozen=True)
class _WithBalances:
    """The equations of a model, with a site at the derivative of each of some states."""

    equations: Callable[[Scope], None]
    states: tuple[str, ...]

    def __call__(self, m: Scope) -> None:
        self.equations(m)
        for name in self.states:
            m.derivatives[name] = m.site(BALANCE + name, m.derivatives[name], "process", "offset")


def with_balances(model: Model) -> Model:
    """The model with a site, to which an amount may be added, at the derivative of each state of its own."""
    states = tuple(s.name for s in model.states if "." not in s.name)  # those of effects have the effect's name first
    return replace(model, equations=_WithBalances(model.equations, states))


def unless_on_a_balance(search: Search, base: Explanation, told: Told) -> Told:
    """What is told; nothing where an event is, and the record tells it from a better one on the balance of a state.

    Parameters
    ----------
    search, base
        The search, and the model as it is.
    told
        What was judged.
    """
    event = next((h for h in told.best.hypotheses if h.kind in EVENTS), None)
    if told.word not in ("named", "class") or event is None:
        return told
    balanced = replace(search, model=with_balances(search.model))
    rest = base if len(told.best.hypotheses) == 1 else search.without(told.best, event)
    rivals = balanced.all_with(rest, _on_balances(balanced, rest, event))
    best = max(rivals, key=lambda e: e.criterion, default=None)
    if best is None or not told_apart(balanced, base, best, told.best):
        return told
    return replace(told, word="abstain", certain=(), open=(), why=_words(balanced, best))


def _on_balances(balanced: Search, rest: Explanation, event: Hypothesis) -> list[Screened]:
    """An amount at the balance of each state: at the times of the event, and at times of its own."""
    sites = [s for s in balanced.model.sites if s.name.startswith(BALANCE)]
    screening = balanced.screening(rest, [s.name for s in sites])
    return [s for site in sites for s in _at(screening, site, event)]


def _at(screening: Screening, site: Site, event: Hypothesis) -> Sequence[Screened]:
    if event.kind == "ramp":
        own = screening.ramp(site)
        return [own] if own is not None else []
    own = screening.switch(site)
    return [*screening.at_times_of(event, site), *([own] if own is not None else [])]


def _words(balanced: Search, explanation: Explanation) -> str:
    """What acts where and when; how much, where the constants are known by which a rate is measured."""
    h, model = explanation.hypotheses[-1], balanced.model_of(explanation)
    when = ", ".join(f"from {a:.0f} s on" if long >= FOREVER else f"{a:.0f}-{a + long:.0f} s" for a, long in h.pulses)
    name = h.site.removeprefix(BALANCE)
    unit = model.states[model.index("states", name)].unit
    amount = model.parameters[model.index("parameters", h.effect.parameter("amplitude"))].value
    measured = balanced.known is not None and not balanced.known.up_to_a_factor()
    rate = f" {abs(amount):.3g} {'1' if unit in ('', '-') else unit}/s" if measured else ""
    does, where = ("adds", "to") if amount > 0 else ("takes", "from")
    words = name.replace("_", " ")
    return f"something {does}{rate} {where} the balance of {words} ({when}), and the model has no site for that"
