"""Replay a stored session: the same cycles on the same snapshots, compared to the bit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Engine, RowMapping, Table, select

from adaptive_flot.errors import LinkError
from adaptive_flot.live.link.cycle import Cycle
from adaptive_flot.live.link_file import Link, LinkFile
from adaptive_flot.live.outcome import Outcome
from adaptive_flot.live.safety.modes import Mode
from adaptive_flot.live.safety.tag_value import Quality, TagValue
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.beside import stored_change
from adaptive_flot.live.store.numbers import as_text, from_column
from adaptive_flot.live.store.resume import Resumed, stored_resumed
from adaptive_flot.live.store.rows import ACTING, ESTIMATED

MOST_SHOWN = 20
"""Differences that are kept in words."""


@dataclass(frozen=True)
class Replay:
    """What a replay found.

    Attributes
    ----------
    session, cycles
        Session, and how many of its cycles were replayed.
    estimates, decisions
        How many of each were compared.
    different
        Cycles that came out differently.
    words
        The first of them, in words.
    """

    session: int
    cycles: int
    estimates: int
    decisions: int
    different: int
    words: tuple[str, ...]


def replay(engine: Engine, link: Link, session: int | None = None) -> Replay:
    """Replay a session from its start, default the last one.

    Raises
    ------
    LinkError
        There is no such session, or it is of another scenario.
    """
    with engine.connect() as connection:
        row = _session(connection, link, session)
        file = LinkFile.model_validate_json(row["link_file"])
        resumed = _resumed(connection, row)
        effects = () if resumed is None else resumed.effects
        cycle = Cycle(Link(path=link.path, file=file, scenario=link.scenario), effects)
        state = cycle.start(None if resumed is None else resumed.prior)
        stored = _Stored(connection, row["session"])
        cycles, different = 0, 0
        words: list[str] = []
        for number, snapshot in stored.snapshots():
            if number in stored.changes:
                change = stored.changes[number]
                cycle = Cycle(cycle.link, change.effects)
                state = cycle.go_on(state, change.prior)
            state, outcome = cycle.step(state, snapshot)
            wrong = stored.differences(number, outcome)
            cycles, different = cycles + 1, different + bool(wrong)
            if wrong and len(words) < MOST_SHOWN:
                words.append(f"cycle {number}: {', '.join(wrong)}")
    counts = len(stored.estimates), len(stored.decisions)
    return Replay(row["session"], cycles, *counts, different, tuple(words))


def _session(connection: Connection, link: Link, session: int | None) -> RowMapping:
    query = select(schema.sessions).order_by(schema.sessions.c.session.desc()).limit(1)
    if session is not None:
        query = query.where(schema.sessions.c.session == session)
    row = connection.execute(query).mappings().first()
    if row is None:
        raise LinkError(f"{link.path}: the database has no session {session or ''}; run `adaptive-flot live` first")
    if row["scenario"] != link.scenario.name:
        raise LinkError(f"{link.path}: session {row['session']} is of scenario {row['scenario']!r}; give its link file")
    return row


def _resumed(connection: Connection, row: RowMapping) -> Resumed | None:
    if row["resumed_session"] is None:
        return None
    return stored_resumed(connection, row["resumed_session"], row["resumed_cycle"])


class _Stored:
    """The rows of a session by cycle."""

    def __init__(self, connection: Connection, session: int) -> None:
        def rows(table: Table) -> Iterator[RowMapping]:
            query = select(table).where(table.c.session == session).order_by(table.c.cycle)
            yield from connection.execute(query).mappings()

        self.cycles = list(rows(schema.cycles))
        self.estimates = {row["cycle"]: row for row in rows(schema.estimates)}
        self.decisions = {row["cycle"]: row for row in rows(schema.decisions)}
        self.changes = {row["cycle"]: stored_change(row) for row in rows(schema.models)}
        self._tags, self._limits, self._writes = (defaultdict[int, list[Any]](list) for _ in range(3))
        for found, table in ((self._tags, schema.tags), (self._limits, schema.limits), (self._writes, schema.writes)):
            for row in rows(table):
                found[row["cycle"]].append(row)

    def snapshots(self) -> Iterator[tuple[int, Snapshot]]:
        """What the plant told in each cycle."""
        operator: dict[str, tuple[float, float]] = {}
        for row in self.cycles:
            number = row["cycle"]
            operator |= {o["input"]: (from_column(o["low"]), from_column(o["high"])) for o in self._limits[number]}
            told = {
                t["tag"]: TagValue(from_column(t["value"]), Quality(t["quality"]), from_column(t["source_time"]))
                for t in self._tags[number]
            }
            acting = {name.removeprefix(ACTING): tag for name, tag in told.items() if name.startswith(ACTING)}
            measured = {name: tag for name, tag in told.items() if not name.startswith(ACTING)}
            switch = None if row["switch"] is None else Mode(row["switch"])
            facts = row["granted"], row["in_time"], row["written"], Mode(row["allowed"])
            time = from_column(row["plant_time"])
            yield number, Snapshot(time, row["alive"], measured, acting, dict(operator), switch, *facts)

    def differences(self, number: int, outcome: Outcome) -> list[str]:
        """What came out differently in a cycle."""
        row = next(iter(self.cycles[number - 1 : number]))
        wrong = [] if outcome.mode.name.lower() == row["mode"] else [f"mode {outcome.mode.name.lower()}"]
        known = self.estimates.get(number)
        if (outcome.estimate is None) != (known is None):
            wrong.append("estimate")
        elif outcome.estimate is not None and known is not None:
            wrong += [name for name in ESTIMATED if as_text(getattr(outcome.estimate, name)) != known[name]]
        decided = self.decisions.get(number)
        if (outcome.decision is None) != (decided is None) or (
            outcome.decision is not None
            and decided is not None
            and as_text(outcome.decision.inputs) != decided["inputs"]
        ):
            wrong.append("decision")
        writes = {w["input"]: w["value"] for w in self._writes[number]}
        return wrong if writes == dict(outcome.writes) else [*wrong, "writes"]
