"""What is certain output by output: which of them an alternative brings down to their noise, and which stay wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.discovery.assessment.verification import AT_NOISE
from adaptive_flot.discovery.results import Judgement, OutputChange
from adaptive_flot.discovery.verdict.words.sizes import spaced
from adaptive_flot.greybox.effects import STATELESS_DRIVERS
from adaptive_flot.greybox.model import FloatArray


def settled(changes: Sequence[OutputChange], noise: FloatArray) -> tuple[tuple[str, ...], tuple[OutputChange, ...]]:
    """Outputs that were wrong and are at their noise after, by name; and those that are still wrong.

    Parameters
    ----------
    changes
        Error of each output on the report rows, before and after.
    noise
        Noise of each from row to row (m,); where it is not known, that of the fit counts.
    """
    known = np.where(noise > 0, noise, [c.noise for c in changes])
    wrong = [(c, c.before > AT_NOISE * s, c.after > AT_NOISE * s) for c, s in zip(changes, known, strict=True)]
    repaired = tuple(c.output for c, was, is_ in wrong if was and not is_)
    # what the fit takes for noise stands beside these words: what is no more than that is not called wrong
    return repaired, tuple(c for c, _, is_ in wrong if is_ and c.after > AT_NOISE * c.noise)


def common(judgement: Judgement) -> tuple[tuple[str, str], ...]:
    """Effects that the best alternative and every one near it have; none where it stands alone."""
    near = [a for a in judgement.rivals if judgement.near(a)]
    if judgement.best is None or not near:
        return ()
    return tuple(n for n in judgement.best.names if all(n in a.names for a in near))


def common_driver(judgement: Judgement) -> str:
    """What some effect of the best alternative and of every one near it has to do with, in a sentence; else empty.

    Where the place stays open, this tells when it acts: with a signal, in time, or late. A constant tells nothing.
    """
    near = [a for a in judgement.rivals if judgement.near(a)]
    if judgement.best is None or not near:
        return ""
    shared = set.intersection(*({driver for _, driver in a.names} for a in (judgement.best, *near)))
    told = [d for d in dict.fromkeys(d for _, d in judgement.best.names) if d in shared]
    signals = [spaced(d) for d in told if d not in STATELESS_DRIVERS]
    if signals:
        return f"All that come near depend on {' and '.join(signals)}."
    return "All that come near change in time." if "time" in told else ""


def certain_words(judgement: Judgement, changes: Sequence[OutputChange], noise: FloatArray) -> str:
    """What is certain of a record that is not told: sentences, empty where nothing is."""
    if judgement.best is None:
        return ""
    said = []
    in_all = common(judgement)
    if in_all:
        said.append(f"In all that come near: {', '.join(f'{s} by {d}' for s, d in in_all)}.")
    elif driver := common_driver(judgement):
        said.append(driver)
    repaired, wrong = settled(changes, noise)
    name = " with ".join(f"{s} by {d}" for s, d in judgement.best.names)
    if repaired:
        said.append(f"{name} brings {', '.join(repaired)} down to the noise.")
    if repaired and wrong:
        still = ", ".join(c.words for c in wrong)
        said.append(f"Still wrong: {still}; look for a further cause there.")
    return " ".join(said)
