"""How contenders look: one colour each, the same on every figure and page."""

from __future__ import annotations

from adaptive_flot.charts.palette import contender_slots
from adaptive_flot.charts.plotdata import Role
from adaptive_flot.runner.commands.comparison import ORACLE, Comparison, Contender


def roles(comparison: Comparison) -> dict[str, tuple[Role, int]]:
    """Role and colour of each contender, by its label; the oracle is black."""
    slots = contender_slots(map(_name, comparison.contenders))
    return {
        c.label: (
            Role.TRUTH if c.estimator == ORACLE else Role.ESTIMATE,
            0 if c.estimator == ORACLE else slots[_name(c)],
        )
        for c in comparison.contenders
    }


def colour_names(comparison: Comparison) -> tuple[str, ...]:
    """Colour of each contender as `charts.palette` names it."""
    return tuple("truth" if role is Role.TRUTH else f"slot-{slot}" for role, slot in roles(comparison).values())


def _name(c: Contender) -> tuple[str, str]:
    return c.controller, f"{c.estimator} ({c.result})" if c.result else c.estimator
