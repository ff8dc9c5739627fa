"""How good a record is, all together, and what follows, in words."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from adaptive_flot.greybox.steady.likely_unit import off_by_a_unit
from adaptive_flot.records.importing import Imported
from adaptive_flot.records.quality.excitation import Excitation, excitation
from adaptive_flot.records.quality.relations import Correlation, Feedback, block_means, correlation, feedback
from adaptive_flot.records.quality.signals import SignalQuality, signal_quality

TOGETHER = 0.95
"""Correlation of two inputs from which their effects can not be told apart."""
MOST_CORRELATED = 5000
"""Rows that are correlated; of more, the means of blocks."""
FEWEST_ROWS = 200
"""Rows that discovery asks for."""


@dataclass(frozen=True)
class Quality:
    """How good a record is.

    Attributes
    ----------
    rows, step_s
        Rows of the record, and its sampling interval [s].
    stretches
        Rows of each stretch.
    signals
        Each quantity.
    excitations
        Each input, over the longest stretch.
    correlations
        Inputs with outputs, and inputs with inputs, over the longest stretch.
    feedbacks
        Each input with each output, over the longest stretch.
    units
        Outputs that are off from the model as if they were in another unit, in words.
    """

    rows: int
    step_s: float
    stretches: tuple[int, ...]
    signals: tuple[SignalQuality, ...]
    excitations: tuple[Excitation, ...]
    correlations: tuple[Correlation, ...]
    feedbacks: tuple[Feedback, ...]
    units: tuple[str, ...] = ()

    def sentences(self) -> list[str]:
        """What follows, the most important first."""
        said = [_amount(self), *(f"{words}." for words in self.units)]
        said += _what_moves(self.excitations)
        said += [
            f"{c.one} and {c.other} move together (correlation {c.r:.2f}): their effects can not be told apart."
            for c in self.correlations
            if abs(c.r) > TOGETHER and {c.one, c.other} <= {e.name for e in self.excitations}
        ]
        said += _loops(self.feedbacks)
        for s in self.signals:
            said += _of_signal(s)
        return said


def judge(imported: Imported) -> Quality:
    """Judge a record; what depends on the order of rows is judged on the longest stretch."""
    rows = imported.rows
    counts = np.bincount(rows.stretch)[1:]
    inside = rows.stretch == 1 + int(np.argmax(counts))
    inputs = [c.quantity.name for c in imported.cleaned if imported.is_input(c.quantity.name)]
    outputs = [c.quantity.name for c in imported.cleaned if not imported.is_input(c.quantity.name)]
    values = {name: rows.values[name][inside] for name in (*inputs, *outputs)}
    pairs = [*((i, o) for i in inputs for o in outputs)]
    size = -(-int(inside.sum()) // MOST_CORRELATED)
    means = {name: block_means(v, size) for name, v in values.items()}
    found = [correlation(a, b, means[a], means[b]) for a, b in pairs]
    found += [correlation(a, b, means[a], means[b], lags=0) for a, b in combinations(inputs, 2)]
    loops = [feedback(i, o, values[i], values[o]) for i, o in pairs]
    return Quality(
        len(rows.time),
        rows.step / 1e9,
        tuple(int(n) for n in counts),
        tuple(signal_quality(c, rows, imported.is_input(c.quantity.name)) for c in imported.cleaned),
        tuple(excitation(name, values[name]) for name in inputs),
        tuple(replace(c, lag=c.lag * size) for c in found if c is not None),
        tuple(f for f in loops if f is not None),
        _units(imported),
    )


def _units(imported: Imported) -> tuple[str, ...]:
    model, rows = imported.model, imported.rows
    known = np.all([np.isfinite(rows.values[name]) for name in model.names("inputs")], axis=0)
    inputs = np.column_stack([rows.values[name][known] for name in model.names("inputs")])
    missing = np.full(int(known.sum()), np.nan)
    names = [name if name in rows.values else None for name in model.names("outputs")]
    outputs = [missing if name is None else rows.values[name][known] for name in names]
    return off_by_a_unit(model, inputs, np.column_stack(outputs)) if known.any() else ()


def _amount(quality: Quality) -> str:
    longest = max(quality.stretches)
    text = f"{quality.rows} rows, one every {quality.step_s:g} s"
    if len(quality.stretches) > 1:
        text += (
            f", in {len(quality.stretches)} stretches; the longest has {longest} rows, and is what a model is run on"
        )
    if longest < FEWEST_ROWS:
        text += f". Discovery asks for {FEWEST_ROWS} rows in one stretch"
    return text + "."


def _what_moves(inputs: tuple[Excitation, ...]) -> list[str]:
    moving = [e.name for e in inputs if e.word == "moves"]
    still = [f"{e.name} ({100 * e.share:.2g} % of its mean)" for e in inputs if e.word != "moves"]
    said = [f"What depends on {_listed(moving)} can be identified: they move."] if len(moving) > 1 else []
    said += [f"What depends on {moving[0]} can be identified: it moves."] if len(moving) == 1 else []
    said += [f"{_listed(still)}: hardly any move, so no dependence on it can be told."] if still else []
    return said


def _loops(pairs: tuple[Feedback, ...]) -> list[str]:
    closed = [f for f in pairs if f.closed]
    if not closed:
        return ["No input seems to be set from an output: the record is in open loop, as far as past values tell."]
    return [
        f"Closed loop, or stamps of {f.input} that are late: past values of {f.output} explain {100 * f.share:.0f} % "
        "of its moves that its own past does not. Correlations then mix the plant with its controller."
        for f in closed
    ]


def _of_signal(s: SignalQuality) -> list[str]:
    said = []
    if s.available < 0.9:
        said.append(f"{s.name} has a value in {100 * s.available:.0f} % of the rows.")
    if s.longest_frozen_s > 0:
        said.append(f"{s.name} does not change for up to {s.longest_frozen_s:g} s: a frozen sensor?")
    if s.drifts:
        said.append(f"{s.name} drifts: {s.drift:+.3g} {s.unit} over the record, most of its spread.")
    return said


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
