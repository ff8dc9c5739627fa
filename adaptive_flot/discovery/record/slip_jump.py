"""A part that stays until more than a band is asked of it, and then jumps: its positions, and how they tell the band.

The same positions go with all bands between the most that was asked in vain and the least that made it jump. So a
record tells the band as a range, and a fit finds no slope between two bands: they are tried one by one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from adaptive_flot.discovery.record.seen import seen_along
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray, Model

BANDS = np.geomspace(0.02, 0.6, 25)
"""Bands that are tried, as shares of the range of what is asked: each is 15 % wider than the last."""
RESTS = (0.0, 0.4, 0.7, 0.95)
"""Rests that are tried, as shares of the band. With one nearly as large it is dragged along: it has play."""
PLAY = 0.9
"""A rest of at least this share of the band is play."""
LEAST_JUMPS = 3
"""What jumps less often shows a step or two in time, which says nothing of a band."""


def jumped(v: FloatArray, band: float, rest: float = 0.0) -> FloatArray:
    """Position (N,) of what stays until a demand (N,) is more than a band away, and then jumps to it, less a rest."""
    demands = v.tolist()  # a loop over plain numbers takes a fifth of the time
    position, at = [], demands[0]
    for demand in demands:
        if abs(demand - at) > band:
            at = demand - math.copysign(rest, demand - at)
        position.append(at)
    return np.array(position)


def same_jumps(v: FloatArray, band: float, rest: float = 0.0) -> tuple[float, float]:
    """Least and largest band with the same positions behind a demand (N,); infinite where it never jumps."""
    position = jumped(v, band, rest)
    asked = np.abs(v - np.concatenate([v[:1], position[:-1]]))
    return float(np.max(asked[asked <= band])), float(np.min(asked[asked > band], initial=np.inf))


def asked_from_outside(model: Model) -> frozenset[str]:
    """Sites whose value depends on inputs and constants alone: an operator or another controller asks for it.

    There the record tells the positions. What the model asks for itself answers to them: once a free run jumps a
    little early or late, it has nothing to do with the plant any more.
    """
    return model.derived(_asked_from_outside)


def _asked_from_outside(model: Model) -> frozenset[str]:
    t, x, u, p, z = model.site_values.sx_in()
    inside = ca.jacobian(model.site_values(t, x, u, p, z), ca.vertcat(x, z)).sparsity()
    rows = set(inside.get_triplet()[0])
    return frozenset(site.name for i, site in enumerate(model.sites) if i not in rows)


class Jump(NamedTuple):
    """A band, a rest, the range of bands with the same positions, and these positions (N,)."""

    band: float
    rest: float
    bands: tuple[float, float]
    position: FloatArray


def jumping(v: FloatArray) -> Iterator[Jump]:
    """Yield what a part may do behind a demand (N,) that jumps.

    Each band is in the middle of those with the same positions. Only bands with at least LEAST_JUMPS jumps. They are
    kept for the next search: what is asked from outside is the same there.
    """
    yield from _tried(np.ascontiguousarray(v, dtype=float).tobytes())


@lru_cache(maxsize=16)
def _tried(demand: bytes) -> tuple[Jump, ...]:
    v, tried = np.frombuffer(demand), []
    for share in RESTS:
        largest = 0.0
        for band in BANDS * float(np.ptp(v)):
            rest = share * float(band)
            if band <= largest:
                continue
            least, largest = same_jumps(v, float(band), rest)
            middle = (max(least, rest) + largest) / 2
            rest = min(rest, RESTS[-1] * middle)
            position = jumped(v, middle, rest)
            if not np.isfinite(middle) or np.count_nonzero(np.diff(position)) < LEAST_JUMPS:
                break
            tried.append(Jump(middle, rest, same_jumps(v, middle, rest), position))
    return tuple(tried)


def band_ranges(
    model: Model, effect: Effect, records: Sequence[Dataset], starts: Sequence[FloatArray]
) -> dict[str, tuple[float, float]]:
    """Range of the band of a fitted effect that is a slip jump, with its rest, by its name; empty for any other effect.

    Parameters
    ----------
    model
        The model with the effect.
    effect
        The effect.
    records, starts
        Records, and the state (nx,) at which each begins.
    """
    if not effect.family.jumps:
        return {}
    (name,), (band,) = effect.names(CoefficientRole.BAND), effect.values(CoefficientRole.BAND)
    (rest,) = effect.values(CoefficientRole.REST) or (0.0,)
    asked = [seen_along(model, record, x0)[0][effect.site] for record, x0 in zip(records, starts, strict=True)]
    each = [same_jumps(v, band, rest) for v in asked if np.isfinite(v).all()]
    return {name: (max(low for low, _ in each), min(high for _, high in each))} if each else {}
