"""What came of the draws, in sentences and as a summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from adaptive_flot.uncertainty.draws import QUANTILES, Draws
from adaptive_flot.uncertainty.ranking import Share

JUDGED = ("concentrate_grade", "recovery")
"""Outputs that are ranked, where the model has them."""
Ranked: TypeAlias = Mapping[str, tuple[Share, ...]]
"""Shares of the constants for each judged output, the largest first."""


def ranked_outputs(draws: Draws) -> Ranked:
    """Shares of the constants for each judged output: the grade and the recovery, or all outputs of another model."""
    names = draws.model.names("outputs")
    return {name: draws.shares(name) for name in [n for n in JUDGED if n in names] or names}


def title(ranked: Ranked) -> str:
    """The answer in a few words."""
    firsts = {name: shares[0] for name, shares in ranked.items() if shares}
    parts = [f"{_spaced(name)}: {first.label} first ({100 * first.total:.0f} %)" for name, first in firsts.items()]
    text = "; ".join(parts) or "No judged output changes from draw to draw"
    return text[:1].upper() + text[1:]


def sentences(draws: Draws, ranked: Ranked) -> list[str]:
    """What a reader wants to know: bands, and who makes them."""
    said = []
    for name, shares in ranked.items():
        means, j = draws.means(name), draws.model.index("outputs", name)
        low, high = np.nanquantile(means, [QUANTILES[0], QUANTILES[-1]])
        band = f"90 % of the draws have a mean {_spaced(name)} from {low:.3g} to {high:.3g}"
        said.append(f"{band}; with the nominal constants it is {draws.nominal[:, j].mean():.3g}.")
        if shares:
            first = ", ".join(f"{s.label} {100 * s.total:.0f} % (± {100 * s.total_half:.0f})" for s in shares[:3])
            said.append(f"Shares in its variance, with others: {first}.")
    lost = len(draws.values) - len(draws.good)
    if lost:
        said.append(f"{lost} of {len(draws.values)} draws left the model's physical range and are left out.")
    return said


def summary(draws: Draws, ranked: Ranked) -> dict[str, Any]:
    """The numbers, for JSON."""
    return {
        "draws": len(draws.values),
        "left_out": len(draws.values) - len(draws.good),
        "constants": {
            c.parameter.name: {"label": c.parameter.label, "unit": c.parameter.unit, "range": c.in_words}
            for c in draws.constants
        },
        "outputs": {
            q.name: {
                "unit": q.unit,
                "nominal_mean": draws.nominal[:, j].mean(),
                "mean_quantiles": dict(
                    zip(map(str, QUANTILES), np.nanquantile(draws.means(q.name), QUANTILES).tolist(), strict=True)
                ),
            }
            for j, q in enumerate(draws.model.outputs)
        },
        "shares": {name: [vars(share) for share in shares] for name, shares in ranked.items()},
    }


def _spaced(name: str) -> str:
    return name.replace("_", " ")
