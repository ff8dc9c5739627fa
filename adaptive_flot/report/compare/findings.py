"""Sentences of a comparison, each made from the numbers at hand: no conclusion is written here."""

from __future__ import annotations

import numpy as np

from adaptive_flot.report.kit.wording import number
from adaptive_flot.runner.commands.comparison import FIXED, ORACLE, Comparison, Contender, SeedSpread

OFTEN = 0.01
"""Share of time below the grade limit from which a contender is named."""


def findings(comparison: Comparison) -> list[str]:
    """Who recaptures how much of the oracle's gain, who breaks the limit, and who earns most within it."""
    return [*_best(comparison), *_gains(comparison), *_limit(comparison)]


def _gains(comparison: Comparison) -> list[str]:
    sentences = []
    for oracle in (c for c in comparison.contenders if c.estimator == ORACLE):
        fixed, gains = comparison.rival(oracle, FIXED), comparison.gain(oracle, "value_cu_h")
        if fixed is None or not gains.size:
            continue
        gain = SeedSpread.of(gains)
        text = (
            f"{oracle.controller}: with the true parameters (oracle) it earns {number(gain.median, '+.3f')} cu/h "
            f"{_range(gain, gains.size, '+.3f')}against fixed ones"
        )
        rivals = [
            c
            for c in comparison.contenders
            if c.controller == oracle.controller
            and c.estimator not in (FIXED, ORACLE)
            and comparison.rival(c, ORACLE) is oracle
        ]
        shares = [(c, comparison.share(c, "value_cu_h")) for c in rivals]
        recaptured = [
            f"{c.estimator} recaptures {_percent(SeedSpread.of(share), share.size)} of it"
            for c, share in shares
            if np.isfinite(share).any()
        ]
        if recaptured:
            sentences.append(f"{text}; {', '.join(recaptured)}.")
        elif gain.median > 0:
            sentences.append(f"{text}.")
        else:
            sentences.append(
                f"{text}, so there is no gain to take a share of: fixed parameters spend {_below(fixed)} of the time "
                f"below the grade limit, the oracle {_below(oracle)}."
            )
    return sentences


def _limit(comparison: Comparison) -> list[str]:
    often = [c for c in comparison.contenders if c.spread("below_limit").median > OFTEN]
    if not often:
        return []
    names = "; ".join(
        f"{c.label} {_below(c)} (mean depth {number(c.spread('mean_depth').median, '.4f')})" for c in often
    )
    return [f"Below the grade limit for more than 1 % of the time: {names}."]


def _best(comparison: Comparison) -> list[str]:
    """Who earns most within the limit; the oracle is no contender, but what it earns is the ceiling."""
    within = [c for c in comparison.contenders if c.has("value_cu_h") and c.spread("below_limit").median <= OFTEN]
    real = [c for c in within if c.estimator != ORACLE]
    if not real or len(within) < 2:
        return []
    best = max(real, key=lambda c: c.spread("value_cu_h").median)
    value = number(best.spread("value_cu_h").median, ".3f")
    oracle = comparison.rival(best, ORACLE)
    ceiling = ""
    if oracle is not None and oracle.has("value_cu_h"):
        ceiling = f" (with the true parameters: {number(oracle.spread('value_cu_h').median, '.3f')})"
    return [f"Highest value among those that keep the limit: {best.label}, {value} cu/h{ceiling}."]


def _below(contender: Contender) -> str:
    return f"{number(100 * contender.spread('below_limit').median, '.1f')} %"


def _percent(share: SeedSpread, count: int) -> str:
    scaled = SeedSpread(100 * share.median, 100 * share.low, 100 * share.high, share.not_finite)
    return f"{number(scaled.median, '.1f')} % {_range(scaled, count, '.1f')}".rstrip()


def _range(spread: SeedSpread, count: int, form: str) -> str:
    return f"[{number(spread.low, form)}, {number(spread.high, form)}] " if count > 1 else ""
