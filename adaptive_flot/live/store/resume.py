"""Where a link goes on after a restart: the last stored estimate, the model that was in use, and the page's switch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, select

from adaptive_flot.contracts import Prior
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.beside import stored_change
from adaptive_flot.live.store.numbers import as_array
from adaptive_flot.live.store.rows import known_of_errors


@dataclass(frozen=True)
class Extension:
    """A model that was taken into use in place of a shorter one.

    Attributes
    ----------
    effects
        All that it has beyond the scenario's.
    before
        Adapted parameters (np,) of the model before, when it was left: a revert goes back to them.
    person
        Who applied it.
    """

    effects: tuple[Effect, ...]
    before: FloatArray
    person: str


@dataclass(frozen=True)
class Resumed:
    """Where a link goes on.

    Attributes
    ----------
    session, cycle
        Of the last stored estimate.
    prior
        That estimate.
    extensions
        How its model came about from the scenario's, oldest first; empty for the scenario's.
    """

    session: int
    cycle: int
    prior: Prior
    extensions: tuple[Extension, ...] = ()

    @property
    def effects(self) -> tuple[Effect, ...]:
        """What the model has beyond the scenario's."""
        return self.extensions[-1].effects if self.extensions else ()


def last_allowed(connection: Connection) -> Mode:
    """How far a person at the page let the link go in the last stored cycle; all the way where there is none."""
    c = schema.cycles.c
    found = connection.execute(select(c.allowed).order_by(c.session.desc(), c.cycle.desc()).limit(1)).scalar()
    return Mode.CLOSED if found is None else Mode(found)


def last_estimate(connection: Connection, link: Link) -> Resumed | None:
    """The last estimate stored for the same scenario and estimator."""
    e, s = schema.estimates.c, schema.sessions.c
    rows = connection.execute(
        select(schema.estimates.c.session, e.cycle, s.link_file)
        .join(schema.sessions, s.session == e.session)
        .where(s.scenario == link.scenario.name)
        .order_by(e.session.desc(), e.cycle.desc())
        .limit(1)
    ).mappings()
    row = rows.first()
    if row is None or f'"estimator":"{link.file.estimator}"' not in row["link_file"]:
        return None
    known = stored_resumed(connection, row["session"], row["cycle"])
    fits = known.prior.parameters.shape == (len(link.scenario.setup.parameters),)
    return known if fits and len(known.prior.state) >= len(link.scenario.setup.model.states) else None


def stored_resumed(connection: Connection, session: int, cycle: int) -> Resumed:
    """The estimate of a cycle, with its model."""
    e = schema.estimates.c
    query = select(schema.estimates).where(e.session == session, e.cycle == cycle)
    row = connection.execute(query).mappings().one()
    arrays: dict[str, Any] = {
        name: as_array(row[name]) for name in ("state", "parameters", "covariance")
    } | known_of_errors(row)
    prior = Prior(0.0, **arrays, ongoing=True)
    return Resumed(session, cycle, prior, _extensions(connection, session, cycle))


def _extensions(connection: Connection, session: int, cycle: int) -> tuple[Extension, ...]:
    """How the model in use in a cycle came about, over all sessions that went on from each other."""
    m, s = schema.models.c, schema.sessions.c
    ends = {
        row[0]: (row[1], row[2]) for row in connection.execute(select(s.session, s.resumed_session, s.resumed_cycle))
    }
    last: dict[int, int] = {}  # of each session, oldest first: the cycle up to which its changes count
    at: tuple[int | None, int | None] = (session, cycle)
    while at[0] is not None and at[1] is not None:
        last = {at[0]: at[1], **last}
        at = ends[at[0]]
    found: list[Extension] = []
    for row in connection.execute(select(schema.models).order_by(m.session, m.cycle)).mappings():
        if row["cycle"] > last.get(row["session"], 0):
            continue
        change = stored_change(row)
        while found and len(found[-1].effects) >= len(change.effects):
            found.pop()
        if len(change.effects) > (len(found[-1].effects) if found else 0):
            before = _parameters_before(connection, row["session"], row["cycle"])
            found.append(
                Extension(change.effects, change.prior.parameters if before is None else before, change.person)
            )
    return tuple(found)


def _parameters_before(connection: Connection, session: int, cycle: int) -> FloatArray | None:
    """Parameters of the last estimate of a session before a cycle; None where there is none."""
    e = schema.estimates.c
    query = select(e.parameters).where(e.session == session, e.cycle < cycle).order_by(e.cycle.desc()).limit(1)
    found = connection.execute(query).scalar()
    return None if found is None else as_array(found)
