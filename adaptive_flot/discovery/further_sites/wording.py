"""What acts where a model has no site, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.further_sites.places import AMOUNT, BALANCE, DRAG, LOSS, RATE, READING, loss_size
from adaptive_flot.discovery.results.words import NO_SITE, rough, short
from adaptive_flot.greybox.model import Model

MOST_SAID = 3
"""So many of what is not told apart are said."""


def change_in_words(model: Model, site: str, amount: float, when: str, measured: bool) -> str:
    """``something takes 0.3 m/s from the balance of level (120-340 s)``.

    Parameters
    ----------
    model
        The model, for the unit.
    site
        Name of the further site.
    amount
        What is added, at a balance in the unit of the state by second; the logarithm of a factor at a rate.
    when
        The times in words; empty for the whole record.
    measured
        Whether the constants are known by which a rate is measured; else no rate is said.
    """
    at = f" ({when})" if when else ""
    if site.startswith(READING):
        name = site.removeprefix(READING)
        unit = model.inputs[model.index("inputs", name)].unit
        off = f"{short(abs(amount))} {'' if unit == '-' else unit}".strip()
        return f"{_plain(name)} were {off} {'more' if amount > 0 else 'less'} than the record says{at}"
    if site.startswith(AMOUNT):
        name = site.removeprefix(AMOUNT)
        size = f"{short(abs(amount))} {next(s.unit for s in model.sites if s.name == name) or '-'}".removesuffix(" -")
        much = f"{size} " if measured else "by an amount "
        return f"{_plain(name)} were {much}{'larger' if amount > 0 else 'smaller'} at any value{at}"
    if site.startswith(RATE):
        name = _plain(site.removeprefix(RATE))
        return f"what stores {name} (a capacity, a volume or a mass) were {rough(np.exp(-amount))} times as large{at}"
    if site.startswith(LOSS):
        name = site.removeprefix(LOSS)
        share = abs(amount) / loss_size(model.states[model.index("states", name)])
        rate = f"{short(100 * share)} % of itself every second" if measured else "a share of itself"
        return f"{_plain(name)} {'lost' if amount > 0 else 'gained'} {rate}{at}"
    if site.startswith(DRAG):
        name = site.removeprefix(DRAG)
        state = model.states[model.index("states", name)]
        usual = abs(float(model.first_guess[model.index("states", name)])) or state.scale  # a plant may never be at 0
        lost = abs(amount) * (usual / loss_size(state)) ** 2
        unit = "1" if state.unit in ("", "-") else state.unit
        at_usual = f"{short(usual)} {unit}".removesuffix(" 1")
        rate = (
            f"{short(lost)} {unit}/s where it is {at_usual}, and more with its square"
            if measured
            else "more with its square"
        )
        return f"{_plain(name)} {'lost' if amount > 0 else 'gained'} {rate}{at}"
    name = site.removeprefix(BALANCE)
    unit = model.states[model.index("states", name)].unit
    rate = f" {short(abs(amount))} {'1' if unit in ('', '-') else unit}/s" if measured else ""
    does, where = ("adds", "to") if amount > 0 else ("takes", "from")
    return f"something {does}{rate} {where} the balance of {_plain(name)}{at}"


def as_if(words: Sequence[str]) -> str:
    """What is not told apart, in words: ``as if something ...; or as if ...: the model has no site for that``."""
    return f"{'; or '.join(f'as if {w}' for w in words[:MOST_SAID])}: {NO_SITE}"


def too_many(parts: int, words: str) -> str:
    """Why nothing is told where so many parts, and what acts at a further place, explain as much."""
    return f"{parts} parts explain it about as well, or it is as if {words}"


def _plain(name: str) -> str:
    return name.replace("_", " ")
