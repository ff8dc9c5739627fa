"""Open a database and store cycles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Connection, Engine, Table, create_engine, event, func, insert, make_url, select
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from adaptive_flot.contracts import Prior
from adaptive_flot.errors import LinkError
from adaptive_flot.live.link_file import Link
from adaptive_flot.live.outcome import Outcome, Written
from adaptive_flot.live.snapshot import Snapshot
from adaptive_flot.live.store import schema
from adaptive_flot.live.store.beside import NOTHING_BESIDE, Beside, action_row, change_row, shadow_row
from adaptive_flot.live.store.numbers import as_column
from adaptive_flot.live.store.resume import last_allowed, last_estimate
from adaptive_flot.live.store.rows import cycle_row, decision_row, estimate_row, result_row, sample_row, tag_rows

Rows = dict[Table, list[dict[str, Any]]]


def open_database(url: str, folder: Path) -> Engine:
    """Open a database, and make its tables where it has none.

    Parameters
    ----------
    url
        As SQLAlchemy reads it; `sqlite:///live.sqlite` is a file in the folder.
    folder
        For relative paths of SQLite files.

    Raises
    ------
    LinkError
        The URL is none, the database can not be reached, or its tables are of another version.
    """
    try:
        parsed = make_url(url)
        if parsed.get_backend_name() == "sqlite" and parsed.database and parsed.database != ":memory:":
            parsed = parsed.set(database=str(folder / parsed.database))
        engine = create_engine(parsed)
        if parsed.get_backend_name() == "sqlite":
            event.listen(engine, "connect", _prepare_sqlite)
        schema.metadata.create_all(engine)
        with engine.connect() as connection:
            known = connection.execute(select(func.max(schema.sessions.c.version))).scalar()
    except ModuleNotFoundError as error:
        raise LinkError(f"database {url!r}: needs the package {error.name!r}; install it") from error
    except (ArgumentError, SQLAlchemyError) as error:
        words = str(getattr(error, "orig", None) or error).splitlines()[0]
        raise LinkError(f"database: can not be used ({words}); correct the key 'database'") from error
    if known is not None and known != schema.VERSION:
        raise LinkError(f"database: has tables of version {known}, this program has {schema.VERSION}; give another one")
    return engine


def _prepare_sqlite(connection: Any, record: object) -> None:
    """A commit is on the disk before it returns, readers do not stop the writer, and foreign keys count."""
    del record
    for words in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        connection.execute(f"PRAGMA {words}")


class Memory:
    """One session of a link: everything between its start and its end.

    Parameters
    ----------
    engine
        The database.
    link
        The link file and its scenario.

    Attributes
    ----------
    session
        Number of the session, from 1.
    resumed
        The last stored estimate of an earlier session with the same scenario and estimator, with its model; None where
        there is none.
    allowed
        How far a person at the page let the link go in the last stored cycle.
    """

    def __init__(self, engine: Engine, link: Link) -> None:
        self._engine = engine
        self._switch: int | None = None
        self._limits: dict[str, tuple[float, float]] = {}
        with self._transaction() as connection:
            self.resumed = last_estimate(connection, link)
            self.allowed = last_allowed(connection)
            last = connection.execute(select(func.max(schema.sessions.c.session))).scalar()
            self.session = (last or 0) + 1
            connection.execute(
                insert(schema.sessions),
                {
                    "session": self.session,
                    "version": schema.VERSION,
                    "started": datetime.now(UTC).isoformat(),
                    "scenario": link.scenario.name,
                    "link_file": link.file.model_dump_json(),
                    "sampling_s": link.scenario.dt,
                    "resumed_session": None if self.resumed is None else self.resumed.session,
                    "resumed_cycle": None if self.resumed is None else self.resumed.cycle,
                },
            )

    def store(
        self,
        snapshot: Snapshot,
        outcome: Outcome,
        began: Prior | None,
        before: Mapping[str, Written],
        found: str = "",
        beside: Beside = NOTHING_BESIDE,
    ) -> None:
        """Store a cycle whole or not at all, before anything of it is written to the plant.

        Parameters
        ----------
        snapshot, outcome
            What the plant told, and what the cycle came to.
        began
            What the estimator was started with; None before.
        before
            What came of the writes of the cycle before.
        found
            What discovery says in this cycle; empty for nothing.
        beside
            What persons did, alarms, shadows, and a change of the model.

        Raises
        ------
        LinkError
            The database can not be written.
        """
        rows: Rows = {schema.cycles: [cycle_row(snapshot, outcome)]}
        rows[schema.tags] = tag_rows(snapshot, outcome)
        rows[schema.events] = self._events(snapshot, outcome)
        if found:
            rows[schema.events].append({"kind": "discovery", "text": found})
        rows[schema.events] += [{"kind": f"alarm {key}"[:120], "text": text} for key, text in beside.alarms.items()]
        rows[schema.actions] = [action_row(k + 1, answered) for k, answered in enumerate(beside.answered)]
        rows[schema.models] = [] if beside.change is None else [change_row(beside.change)]
        rows[schema.limits] = self._changed_limits(snapshot)
        if outcome.sample is not None:
            rows[schema.samples] = [sample_row(outcome)]
        if outcome.estimate is not None and began is not None:
            rows[schema.estimates] = [estimate_row(outcome.estimate, began)]
        if outcome.decision is not None:
            rows[schema.decisions] = [decision_row(outcome)]
        rows[schema.writes] = [{"input": name, "value": value} for name, value in outcome.writes.items()]
        key = {"session": self.session, "cycle": outcome.number}
        with self._transaction() as connection:
            for table, of_table in rows.items():
                if of_table:
                    connection.execute(insert(table), [{**key, **row} for row in of_table])
            if before:
                earlier = {"session": self.session, "cycle": outcome.number - 1}
                connection.execute(insert(schema.results), [{**earlier, **result_row(n, w)} for n, w in before.items()])
            if beside.shadows:
                shown = [{"session": self.session, **shadow_row(result)} for result in beside.shadows]
                connection.execute(insert(schema.shadows), shown)
        if snapshot.switch is not None:
            self._switch = int(snapshot.switch)
        self._limits.update(snapshot.operator)

    def close(self) -> None:
        """Let the database go."""
        self._engine.dispose()

    def _events(self, snapshot: Snapshot, outcome: Outcome) -> list[dict[str, Any]]:
        found = []
        if outcome.reason:
            found.append({"kind": "mode", "text": f"{outcome.mode.name.lower()}: {outcome.reason}"})
        if snapshot.switch is not None and int(snapshot.switch) != self._switch:
            found.append({"kind": "operator switch", "text": f"switch at {snapshot.switch.name.lower()}"})
        return found

    def _changed_limits(self, snapshot: Snapshot) -> list[dict[str, Any]]:
        """The operator's limits where they differ from those stored last."""
        return [
            {"input": name, "low": as_column(low), "high": as_column(high)}
            for name, (low, high) in snapshot.operator.items()
            if not np.array_equal((low, high), self._limits.get(name, ()), equal_nan=True)
        ]

    @contextmanager
    def _transaction(self) -> Iterator[Connection]:
        try:
            with self._engine.begin() as connection:
                yield connection
        except SQLAlchemyError as error:
            words = str(getattr(error, "orig", None) or error).splitlines()[0]
            raise LinkError(f"database: can not be written ({words})") from error
