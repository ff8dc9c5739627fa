"""What ran in shadow beside what acted, over a stored session: errors on the same rows, and what each would set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sqlalchemy import Engine, RowMapping, func, select

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.numbers import as_array


@dataclass(frozen=True)
class Beside:
    """One quantity of a shadow beside that of what acted.

    Attributes
    ----------
    role
        Its name.
    quantity
        What is compared, with its unit.
    rows
        Rows that both have.
    acting, shadow
        Root mean square one-step error of an output; mean of a set-point that was decided.
    """

    role: str
    quantity: str
    rows: int
    acting: float
    shadow: float


def compare(engine: Engine, link: Link, session: int | None = None) -> list[Beside]:
    """Compare all shadows of a session with what acted, default of the last one.

    Raises
    ------
    LinkError
        Nothing ran in shadow.
    """
    s, e, d = schema.shadows, schema.estimates, schema.decisions
    with engine.connect() as connection:
        chosen = session or connection.execute(select(func.max(schema.sessions.c.session))).scalar()
        both = s.outerjoin(e, (s.c.session == e.c.session) & (s.c.cycle == e.c.cycle))
        both = both.outerjoin(d, (s.c.session == d.c.session) & (s.c.cycle == d.c.cycle))
        columns = (s.c.role, s.c.innovation, s.c.inputs, e.c.innovation.label("own"), d.c.inputs.label("decided"))
        query = select(*columns).select_from(both).where(s.c.session == chosen).order_by(s.c.role, s.c.cycle)
        rows = connection.execute(query).mappings().all()
    if not rows:
        raise LinkError(f"{link.path}: nothing ran in shadow in session {chosen or ''}; give the key 'shadows'")
    found = []
    for role in dict.fromkeys(row["role"] for row in rows):
        of_role = [row for row in rows if row["role"] == role]
        found += [*_errors(link, role, of_role), *_decisions(link, role, of_role)]
    return found


def _errors(link: Link, role: str, rows: list[RowMapping]) -> list[Beside]:
    pairs = [(as_array(r["own"]), as_array(r["innovation"])) for r in rows if r["own"] and r["innovation"]]
    if not pairs:
        return []
    errors = np.array(pairs)  # (rows, 2, outputs)
    seen = np.isfinite(errors).all(axis=1)
    found = []
    for j, q in enumerate(link.scenario.model.outputs):
        if seen[:, j].any():
            acting, shadow = np.sqrt(np.mean(errors[seen[:, j], :, j] ** 2, axis=0))
            words = f"one-step error of {q.name} [{q.unit}]"
            found.append(Beside(role, words, int(seen[:, j].sum()), float(acting), float(shadow)))
    return found


def _decisions(link: Link, role: str, rows: list[RowMapping]) -> list[Beside]:
    pairs = [(as_array(r["decided"]), as_array(r["inputs"])) for r in rows if r["decided"] and r["inputs"]]
    if not pairs:
        return []
    model = link.scenario.model
    acting, shadow = np.array(pairs).mean(axis=0)
    found = []
    for name in link.file.writes:
        j = model.index("inputs", name)
        words = f"mean {name} decided [{model.inputs[j].unit}]"
        found.append(Beside(role, words, len(pairs), float(acting[j]), float(shadow[j])))
    return found
