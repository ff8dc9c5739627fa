"""What acts where the model has no site: on the balance of a state, or on what an input says.

A tank with a leak and a model without one: a pump that gives less comes nearest, and would get the name. Cooling water
that is warmer than its thermometer says is told as less water. So before a part gets a name, a constant amount of its
own is put into the balance of each state in turn, and added to each input. Where one of these explains the new records
surely better than all that would be told, the model has no place for what has changed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from adaptive_flot.discovery.candidates.catalogue import passed_on
from adaptive_flot.discovery.fitting.parallel import parallel_map
from adaptive_flot.discovery.hypotheses.calibration import Calibration
from adaptive_flot.discovery.hypotheses.comparison import Blocks, stands, tied
from adaptive_flot.discovery.hypotheses.cross_validation import (
    REFRESH,
    Tested,
    fit_all_rows,
    refined,
    test_on_stretches,
)
from adaptive_flot.discovery.hypotheses.families import Hypothesis, constant_amount
from adaptive_flot.discovery.hypotheses.joint.fit import JointFit
from adaptive_flot.discovery.hypotheses.joint.rows import Rows
from adaptive_flot.discovery.hypotheses.judgement import Judged, UsualLoss, WithoutSite
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.scope import Scope, Site

BALANCE, READING = "balance of ", "reading of "
"""How the names of the further sites begin."""
NO_SITE = "the model has no site for that"
MOST_SAID = 3
"""So many of what is not told apart are said."""


class _Read(Scope):
    """A scope whose inputs pass a site each, where they are asked for first; all else is that of the scope given."""

    def __init__(self, scope: Scope) -> None:
        self.__dict__ = scope.__dict__
        self._read: dict[str, ca.SX] = {}

    def input(self, name: str) -> ca.SX:
        if name not in self._read:
            self._read[name] = self.site(READING + name, super().input(name), "actuator", "offset")
        return self._read[name]


@dataclass(frozen=True)
class _WithFurtherSites:
    """The equations of a model, with a site at each input and at the derivative of each of some states."""

    equations: Callable[[Scope], None]
    states: tuple[str, ...]

    def __call__(self, m: Scope) -> None:
        self.equations(_Read(m))
        for name in self.states:
            m.derivatives[name] = m.site(BALANCE + name, m.derivatives[name], "process", "offset")


def with_further_sites(model: Model) -> Model:
    """The model with sites where it has none: at the derivative of each state of its own, and at each input."""
    states = tuple(s.name for s in model.states if "." not in s.name)  # those of effects have the effect's name first
    return replace(model, equations=_WithFurtherSites(model.equations, states))


def further_sites(model: Model) -> tuple[Site, ...]:
    """The further sites of such a model."""
    return tuple(s for s in model.sites if s.name.startswith((BALANCE, READING)))


def amount_in_words(model: Model, site: str, amount: float, when: str, measured: bool) -> str:
    """``something takes 0.3 m/s from the balance of level (120-340 s)``.

    Parameters
    ----------
    model
        The model, for the unit.
    site
        Name of the further site.
    amount
        What is added, at a balance in the unit of the state by second.
    when
        The times in words; empty for the whole record.
    measured
        Whether the constants are known by which a rate is measured; else no rate is said.
    """
    at = f" ({when})" if when else ""
    if site.startswith(READING):
        name = site.removeprefix(READING)
        unit = model.inputs[model.index("inputs", name)].unit
        off = f"{abs(amount):.3g} {'' if unit == '-' else unit}".strip()
        return f"{name.replace('_', ' ')} were {off} {'more' if amount > 0 else 'less'} than the record says{at}"
    name = site.removeprefix(BALANCE)
    unit = model.states[model.index("states", name)].unit
    rate = f" {abs(amount):.3g} {'1' if unit in ('', '-') else unit}/s" if measured else ""
    does, where = ("adds", "to") if amount > 0 else ("takes", "from")
    return f"something {does}{rate} {where} the balance of {name.replace('_', ' ')}{at}"


def as_if(words: Sequence[str]) -> str:
    """What is not told apart, in words: ``as if something ...; or as if ...: the model has no site for that``."""
    return f"{'; or '.join(f'as if {w}' for w in words[:MOST_SAID])}: {NO_SITE}"


def is_meant(model: Model, h: Hypothesis, place: str) -> bool:
    """Whether a hypothesis says the same as an amount at a further site.

    An amount at a site that stands for one, and an input that is asked of the actuator whose site it passes.
    """
    site = next(s for s in model.sites if s.name == h.site)
    if place.startswith(READING):
        return passed_on(model).get(site.name) == place.removeprefix(READING)
    return site.mode == "offset" and site.role != "sensor" and (h.effect.mode or site.mode) == "offset"


def unless_without_a_site(
    calibration: Calibration,
    rows: Rows,
    blocks: Blocks,
    null: Tested,
    judged: Judged,
    usual: UsualLoss,
    base: JointFit,
    processes: int = 1,
    ends: float = float("inf"),
) -> Judged:
    """What is told since a reference; nothing where what has no site surely explains more, a class where as much.

    Parameters
    ----------
    calibration
        Constants and the model, from the reference.
    rows, blocks
        The new records, and the blocks that they are judged on.
    null
        The model as it is.
    judged
        What would be told.
    usual
        What the model costs on its reference.
    base
        Fit of the model as it is to the new records.
    processes
        Fits that run at once.
    ends
        Time of `time.monotonic` after which nothing more is fitted.
    """
    if judged.word not in ("named", "class") or judged.best is None:
        return judged
    model, constants = with_further_sites(calibration.model), calibration.constants

    def tested(h: Hypothesis) -> Tested | None:
        if time.monotonic() > ends:
            return None
        with np.errstate(all="ignore"):
            fitted = fit_all_rows(model, rows, h, constants, base, refresh=REFRESH)
            if fitted is None:
                return None
            return test_on_stretches(model, rows, refined(model, rows, fitted), hold_constants=True)

    found = parallel_map(tested, _amounts(model, base, rows), processes, lambda: None)
    stand = (t for t in found if t is not None and stands(rows, blocks, null, t, usual.errors))
    rivals = sorted(stand, key=lambda t: t.total)
    if not rivals:
        return judged

    def words(t: Tested) -> WithoutSite:
        assert t.hypothesis is not None  # each adds an amount
        amount, place = t.fit.value(t.hypothesis.effect.parameter("amplitude")), t.hypothesis.site
        said = amount_in_words(model, place, amount, "", not constants.up_to_a_factor())
        return WithoutSite(place, "constant", said)

    def alike(best: Tested, others: Sequence[Tested]) -> tuple[Tested, ...]:
        return tied(blocks, null, best, others, usual.exceeded(best, rows.count, len(blocks.edges)) is None)

    best, told = rivals[0], [judged.best, *judged.alike]
    if best.total < judged.best.total and not alike(best, told):
        near = (best, *alike(best, rivals[1:]))
        return replace(judged, word="abstain", why=as_if([words(t).words for t in near]))
    said = [t.hypothesis for t in told if t.hypothesis is not None]
    others = [t for t in rivals if t.hypothesis and not any(is_meant(model, h, t.hypothesis.site) for h in said)]
    near = alike(judged.best, others)
    return replace(judged, beside=words(near[0])) if judged.word == "named" and near else judged


def _amounts(model: Model, base: JointFit, rows: Rows) -> Sequence[Hypothesis]:
    seen, _ = seen_values(model, base, rows.records)
    sizes = ((s, float(np.ptp(np.quantile(seen[s.name], (0.05, 0.95))))) for s in further_sites(model))
    return [constant_amount(site, size) for site, size in sizes if size > 0]
