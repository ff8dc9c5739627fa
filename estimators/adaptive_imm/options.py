"""Checks of the options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from adaptive_flot.errors import ModelError, near_match
from estimators.adaptive_imm.modes import KINDS


def check_modes(modes: Sequence[str]) -> None:
    """Raise a `ModelError` for a mode that does not exist, or for none."""
    for kind in modes:
        if kind not in KINDS:
            raise ModelError(f"adaptive_imm: unknown mode {kind!r}; {near_match(kind, KINDS)}")
    if not modes:
        raise ModelError("adaptive_imm: there is no mode; name some, for example rest and walk")


def check_numbers(not_negative: Mapping[str, float], positive: Mapping[str, float]) -> None:
    """Raise a `ModelError` for the first one that is not finite, below zero, or zero where that has no meaning."""
    for name, value in not_negative.items():
        if not (value >= 0 and np.isfinite(value)):
            raise ModelError(f"adaptive_imm: {name} = {value:g}; give 0 or a positive number")
    for name, value in positive.items():
        if not (value > 0 and np.isfinite(value)):
            raise ModelError(f"adaptive_imm: {name} = {value:g}; give a positive number")


def check_shares(outlier_share: float, reference_share: float, shares: Sequence[float]) -> None:
    """Raise a `ModelError` where shares are none."""
    for name, value in {"outlier_share": outlier_share, "reference_share": reference_share}.items():
        if not 0 <= value < 1:
            raise ModelError(f"adaptive_imm: {name} = {value:g}; it must lie in [0, 1)")
    if not (len(shares) == 3 and min(shares) >= 0 and sum(shares) <= 1):
        raise ModelError(f"adaptive_imm: shares = {list(shares)}; give three that add up to 1 at most")
