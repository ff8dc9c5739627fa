"""What the page shows beside the chart: the card of discovery, and what runs in shadow."""

from __future__ import annotations

from typing import Any

from adaptive_flot.live.link_file import TRIED, Link
from adaptive_flot.live.page.axes import Axes, Shown, is_share, plain
from adaptive_flot.live.running.progress import Progress, Stage
from adaptive_flot.live.shadow.process import ShadowView


class BesideTheChart:
    """Makes plain numbers and words of findings and shadows.

    Parameters
    ----------
    link
        The link file and its scenario.
    axes
        The panels: a quantity is shown here as it is there.
    """

    def __init__(self, link: Link, axes: Axes) -> None:
        self._model, self._axes = link.scenario.model, axes
        self._names = self._model.names("outputs")

    def effects(self, progress: Progress) -> list[str]:
        """What the model in use has beyond the scenario's, in words."""
        more = progress.model.effects[len(self._model.effects) :] if progress.extended else ()
        return [effect.label.replace("_", " ") for effect in more]

    def card(self, progress: Progress, offset: float) -> dict[str, Any] | None:
        """What discovery found, and what was made of it; the plant's clock is `offset` ahead of the record's [s]."""
        if progress.card is None:
            return None
        card, finding = progress.card, progress.card.finding
        tried = progress.shadows.get(TRIED)
        stages = (Stage.FOUND, Stage.REVERTED, *(() if tried is not None and tried.runs else (Stage.SHADOW,)))
        return {
            "since": plain(card.since + offset, 14),
            "word": finding.word,
            "reason": finding.reason,
            "evidence": list(finding.evidence),
            "errors": [self._error(*e) for e in finding.errors],
            "tried": [self._error(name, self._unit(name), a, b) for name, a, b in card.errors],
            "stage": card.stage.value,
            "by": card.by,
            "can": bool(finding.effects),
            "tries": bool(finding.effects) and card.stage in stages,
        }

    def shadow(self, view: ShadowView) -> dict[str, Any]:
        """What runs in shadow, beside what acts."""
        plan, newest = view.plan, view.newest
        who = f"{plan.estimator}{f' and {plan.controller}' if plan.controller else ''}"
        more = f", {len(plan.effects)} effect{'s' * (len(plan.effects) > 1)}" if plan.effects else ""
        wants = []
        if newest is not None and newest.decision is not None:
            inputs = self._model.names("inputs")
            moved = [a for a in self._axes.axes if a.kind == "input"]
            wants = [
                {
                    "name": a.shown.label,
                    "unit": a.shown.unit,
                    "value": plain(a.shown.factor * float(newest.decision.inputs[inputs.index(a.name)]), 4),
                }
                for a in moved
            ]
        return {
            "role": plan.role.replace("_", " "),
            "who": who + more,
            "status": view.status,
            "runs": view.runs,
            "left_out": view.left_out,
            "rows": view.compared.rows,
            "ms": None if newest is None else plain(1000 * newest.seconds, 3),
            "errors": [self._error(name, self._unit(name), a, b) for name, a, b in view.compared.errors],
            "wants": wants,
        }

    def _unit(self, output: str) -> str:
        return self._model.outputs[self._names.index(output)].unit

    def _error(self, name: str, unit: str, before: float, after: float) -> dict[str, Any]:
        share = name in self._names and is_share(self._model.outputs[self._names.index(name)])
        shown = Shown.of(name, unit, (before, after), share)
        factor = shown.factor
        return {
            "name": shown.label,
            "unit": shown.unit,
            "before": plain(factor * before, 3),
            "after": plain(factor * after, 3),
        }
