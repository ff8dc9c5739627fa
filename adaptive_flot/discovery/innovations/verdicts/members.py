"""Members of a class as alternatives of a free run: for the page, and for a test that would tell them apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.innovations.search.explanation import Explanation
from adaptive_flot.discovery.innovations.telling_apart import block_sums
from adaptive_flot.discovery.results import Alternative


def alternative(explanation: Explanation, fit: Fit, before: Fit, best: Explanation) -> Alternative:
    """An explanation with its fit of a free run; its criterion is that of the innovations form.

    The standard deviation is that of minus two log-likelihood against the best one, from blocks of rows: with their k
    sums d_j, it is ``2 sqrt(k) sd(d_j)``. Vuong, *Econometrica* 57 (1989) 307, with blocks for rows.

    Parameters
    ----------
    explanation, best
        The explanation, and the best one.
    fit, before
        Fits of a free run with its effects, and of the model as it is.
    """
    names = tuple((h.site, h.driver) for h in explanation.hypotheses)
    blocks = block_sums(best.fit.rows - explanation.fit.rows)
    return Alternative(
        names,
        (True,) * len(names),
        fit,
        before.loss - fit.loss,
        fit.bic - before.bic,
        float(2 * np.sqrt(len(blocks)) * blocks.std()),
        -2 * explanation.criterion,
    )


def others(
    best: Explanation, members: Sequence[Explanation], fitted: Callable[[Explanation], Fit | None], before: Fit
) -> tuple[Alternative, ...]:
    """The other members of a class, those that a free run can be fitted for.

    Parameters
    ----------
    best, members
        The best explanation, and that of each member.
    fitted
        Fits a free run with the effects of an explanation.
    before
        Fit of the model as it is.
    """
    found = []
    for e in members:
        fit = fitted(e) if e is not best else None
        if fit is not None:
            found.append(alternative(e, fit, before, best))
    return tuple(found)
