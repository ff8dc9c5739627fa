"""The report split has a veto: what held-out rows contradict is not told as a name.

A name is contradicted where an output gets worse on these rows, where no output surely gets better, or where nearly all
of a large error is left. Of effects that were looked for at once, each output that stays far above its noise must get
better. Beside a background the likelihood of these rows may stand for that, as it knows what a wandering feed does to
the error: where they are surely likelier, one error must be much smaller. The constants of a background, each a little
off, may also predict what one does that is far off: then no error need be smaller. A free curve in time at a sensor
must also hold on the last of these rows, which lie beyond all that it was fitted to: such a curve can mimic any
residual between rows that it has seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.discovery.assessment.verification import AT_NOISE, MUCH_WORSE, WORSE
from adaptive_flot.discovery.record.problem import Problem
from adaptive_flot.discovery.record.robust import noise_beside_motion
from adaptive_flot.discovery.results import Judgement, OutputChange
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

BETTER = 0.01
"""Share by which the error of one output must fall: less is certain at times, and nothing that a user would see."""
LITTLE = 0.1
"""Share of the squared error that a name must remove where much is left: less may be any name's."""
WORSE_ON_FEW_ROWS = 0.5
"""Share by which an error on the few rows of an event is worse whatever its interval."""
FAR_FROM_NOISE = 5.0
"""An error of so many times the noise is not explained, whatever the noise model says. Noise that is allowed to be
coloured has up to three times what its differences show."""
WELL_ABOVE = 2.0
"""An error of so many times the noise is said to be above it where nothing is told to be missing."""


def contradiction(
    judgement: Judgement,
    changes: Sequence[OutputChange],
    noise: FloatArray,
    unknown: FloatArray | None = None,
    likelier: bool = False,
    alike: bool = False,
    few: bool = False,
) -> str:
    """What the report rows say against a name; empty where they do not, and where no name is given.

    An output is worse where its error after, a, is above ``AT_NOISE s`` and either ``a > (1 + MUCH_WORSE) b`` or
    ``a > (1 + WORSE) b`` with a 95 % interval of the reduction below zero; b is its error before and s its noise. The
    second does not count below ``AT_NOISE sqrt(s^2 + v^2)``, where v is the limit of what the background leaves unknown
    there: so small a difference is the course of a feed, which these rows did not fit.

    Parameters
    ----------
    judgement
        The word before the veto.
    changes
        Error of each output on the report rows, before and after.
    noise
        Noise of each of these outputs from row to row, which no model has fitted (m,).
    unknown
        Limit of what the background leaves unknown in each of them (m,), see `unknown_of_background`.
    likelier
        Whether these rows are surely likelier than with the background alone. Then no error is worse that is within
        what noise and background leave unknown, and one that is much smaller is reason enough (see `much_better`).
    alike
        Whether the background has what is told as one of its constants. Both then predict alike, and no output needs to
        get better where the rows are likelier.
    few
        Whether these are the few rows of an event that passes. Then an error is larger that surely is, or by half.
    """
    if judgement.word not in WITH_A_NAME:
        return ""
    if said := made_worse(changes, noise, unknown, likelier, few):
        return said
    if not surely_better(changes) and not (likelier and (alike or much_better(changes))):
        said = ", ".join(c.words for c in changes)
        return f"on held-out rows no output surely gets better ({said})"
    return ""


def made_worse(
    changes: Sequence[OutputChange],
    noise: FloatArray,
    unknown: FloatArray | None = None,
    likelier: bool = False,
    few: bool = False,
) -> str:
    """The outputs that are worse, in words; empty where none is. Arguments are as in `contradiction`."""
    both = noise if unknown is None else np.hypot(noise, unknown)
    least = both if likelier else noise
    worse = [
        c
        for c, s, v, e in zip(changes, noise, both, least, strict=True)
        if _is_worse(c, float(s), float(v)) and c.after > AT_NOISE * e and not (few and _may_be_chance(c))
    ]
    if not worse:
        return ""
    said = ", ".join(c.words for c in worse)
    return f"on held-out rows it makes the error larger ({said})"


def surely_better(changes: Sequence[OutputChange]) -> bool:
    """Whether the error of one output falls by more than chance, and by as much as a user would see."""
    return any(c.reduction95[0] > 0 and c.after < (1 - BETTER) * c.before for c in changes)


def much_better(changes: Sequence[OutputChange]) -> bool:
    """Whether the error of one output falls by more than MUCH_WORSE, whatever the interval of that.

    The few blocks of these rows tell little where the course of a feed, which both fits have, is most of the error.
    Where they are surely likelier with the effect, a wide interval is no reason to doubt what falls by so much.
    """
    return any(c.after < (1 - MUCH_WORSE) * c.before for c in changes)


def unexplained(changes: Sequence[OutputChange], noise: FloatArray) -> str:
    """Outputs whose error after is far from their noise from row to row, in words; empty where none is.

    A record is not explained because its noise model has swallowed what is wrong: the noise by differences knows no
    model. Arguments are as in `contradiction`; the noise takes in what the background leaves unknown.
    """
    said = _above(changes, noise, FAR_FROM_NOISE)
    return f"The error is far above the noise from row to row: {said}." if said else ""


def rests_on_memory(changes: Sequence[OutputChange], noise: FloatArray) -> str:
    """What `none` rests on where an error is well above the noise from row to row, in words; empty where none is.

    Noise with a memory is that large, and what is missing may be. Arguments are as in `unexplained`.
    """
    said = _above(changes, noise, WELL_ABOVE)
    if not said:
        return ""
    above = f"above the noise from row to row are {said}"
    return f"That rests on noise with a memory, and something may be missing: {above}."


def _above(changes: Sequence[OutputChange], noise: FloatArray, factor: float) -> str:
    """Outputs whose error after is so many times their noise, in words."""
    far = [(c, s) for c, s in zip(changes, noise, strict=True) if s > 0 and c.after > factor * s]
    return ", ".join(f"{c.output} {c.after:.3g} {c.unit}".rstrip(" -") + f" ({_times(c.after / s)})" for c, s in far)


def _times(ratio: float) -> str:
    return f"{ratio:.0f} times" if ratio >= 10 else f"{ratio:.2g} times"


def explains_little(changes: Sequence[OutputChange], noise: FloatArray) -> str:
    """Why a name is not told that leaves nearly all of a large error, in words; empty where it does not.

    With the errors b before and a after, and the noise s, of each output j::

        sum_j (a_j / s_j)^2 > (1 - LITTLE) sum_j (b_j / s_j)^2

    and an output is far from its noise (see `unexplained`, whose arguments these are). What is left then bends
    whichever name is tried.
    """
    seen = [(c.before / s, c.after / s) for c, s in zip(changes, noise, strict=True) if s > 0]
    before, after = (sum(e[k] ** 2 for e in seen) for k in (0, 1))
    if not after > (1 - LITTLE) * before or not (left := unexplained(changes, noise)):
        return ""
    removed = 100 * max(0.0, 1 - after / before)
    return (
        f"on held-out rows it removes only {removed:.0f} % of the squared error, over all outputs. {left.rstrip('.')}"
    )


def without_gain(changes: Sequence[OutputChange], noise: FloatArray) -> str:
    """Outputs, in words, that stay far from their noise (m,) and that a set of effects surely improves nothing of.

    Asked of sets that were looked for at once: all rows but these chose them, so these alone can contradict. An
    oxygen demand that nobody measured came in spells, and a control loop made it look like laws of other signals.
    """
    left = [
        c
        for c, s in zip(changes, noise, strict=True)
        if min(c.before, c.after) > WELL_ABOVE * s and c.reduction95[0] <= 0
    ]
    said = ", ".join(c.words for c in left)
    return f"on held-out rows nothing is surely gained of what stays far above its noise ({said})" if left else ""


def _may_be_chance(change: OutputChange) -> bool:
    """Whether an error on few rows may be larger by chance: its interval says so, and it grew by less than half."""
    return change.reduction95[1] > 0 and change.after < (1 + WORSE_ON_FEW_ROWS) * change.before


def _is_worse(change: OutputChange, noise: float, with_background: float = 0.0) -> bool:
    if change.after <= AT_NOISE * noise:
        return False
    surely = change.after > (1 + WORSE) * change.before and change.reduction95[1] < 0
    return (surely and change.after > AT_NOISE * with_background) or change.after > (1 + MUCH_WORSE) * change.before


def contradiction_at_the_end(
    judgement: Judgement, changes: Sequence[OutputChange], noise: FloatArray, unknown: FloatArray | None = None
) -> str:
    """What the last report rows say against a sensor whose error is a free curve in time; empty where nothing.

    Arguments are as in `contradiction`, for the rows of `last_report_rows` alone. They lie beyond all that fitted the
    background as well. So `unknown` is what it leaves open there, where the report rows are surely likelier.
    """
    best = judgement.best
    if judgement.word not in WITH_A_NAME or best is None:
        return ""
    sensors = {site.name for site in best.fit.model.sites if site.role == "sensor"}
    if not any(e.driver == "time" and e.family.is_curve and e.site in sensors for e in best.effects):
        return ""
    both = noise if unknown is None else np.hypot(noise, unknown)
    worse = [
        c
        for c, s, v in zip(changes, noise, both, strict=True)
        if _is_worse(c, float(s), float(v)) and c.after > AT_NOISE * v
    ]
    if not worse:
        return ""
    said = ", ".join(c.words for c in worse)
    return f"beyond the rows that it was fitted to it makes the error larger ({said})"


def last_report_rows(problem: Problem) -> Problem:
    """The same problem with the last contiguous part of its report split alone."""
    rows = np.flatnonzero(problem.rows("report"))
    if not rows.size:
        return problem
    breaks = np.flatnonzero(np.diff(rows) > 1)
    last = rows[breaks[-1] + 1 :] if breaks.size else rows
    splits = problem.splits.copy()
    splits[np.setdiff1d(rows, last)] = ""
    return replace(problem, splits=splits)


def noise_from_row_to_row(
    problem: Problem, model: Model, changes: Sequence[OutputChange], report: Dataset | None = None
) -> FloatArray:
    """Noise of each changed output (m,) on the report rows, from its differences from row to row.

    Where the noise grows with the value, as the weights w of the problem say, its root mean square over these rows::

        s_y / w sqrt(mean of w^2)        with s_y / w the noise of y / w by differences (`noise_beside_motion`)

    A record of its own that reports has no weights.
    """
    if report is not None:
        outputs = report.outputs[:, [model.index("outputs", c.output) for c in changes]]
        return np.asarray(np.nan_to_num(noise_beside_motion(outputs)))
    columns = [problem.columns.index(model.index("outputs", c.output)) for c in changes]
    weights = problem.weights[:, columns]
    size = np.sqrt(np.nanmean(weights[problem.rows("report")] ** 2, axis=0))
    return np.asarray(np.nan_to_num(noise_beside_motion(problem.measured[:, columns] / weights) * size))
