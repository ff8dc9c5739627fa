"""Which inputs a test may move: not those that are only measured, nor those that a loop sets from an output."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.records.quality.relations import feedback


def held_inputs(model: Model, record: Dataset, allowed: Collection[str] = ()) -> dict[str, str]:
    """Inputs that a test must leave alone, and why, in words.

    An input is in feedback where past outputs predict it beyond its own past (`feedback`); to move it, the loop must be
    opened. Those in `allowed` may be moved, since the user has given a range for them.
    """
    held = {}
    for q, u in zip(model.inputs, record.inputs.T, strict=True):
        if q.name in allowed:
            continue
        if not q.movable:
            held[q.name] = "only measured"
            continue
        seen = [(o.name, y) for o, y in zip(model.outputs, record.outputs.T, strict=True) if np.isfinite(y).any()]
        found = [f for name, y in seen if (f := feedback(q.name, name, u, y)) is not None and f.closed]
        if found:
            held[q.name] = f"in feedback: it follows {max(found, key=lambda f: f.share).output}"
    return held


def held_words(held: dict[str, str]) -> str:
    """The inputs that are left alone, in words.

    >>> held_words({"room": "only measured"})
    'room (only measured)'
    """
    return ", ".join(f"{name} ({why})" for name, why in held.items())
