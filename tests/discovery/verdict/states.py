"""The state of a discovery before the report rows have their say."""

from __future__ import annotations

from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Discovery, Judgement, State


def state_of(draught: Discovery, judgement: Judgement, after: Fit | None = None) -> State:
    """The search of a discovery with a judgement; default the fits before and after that it has."""
    assert draught.problem is not None and draught.before is not None and draught.after is not None
    return State(
        draught.model, draught.problem.adapted, None, None, 1, lambda stage: None, draught.screening,
        problem=draught.problem, base=draught.before, search=draught.search, judgement=judgement,
        before=draught.before, after=after or draught.after,
    )  # fmt: skip
