"""The tables. Every key begins with session and cycle: no row can be stored twice, and none stands for two things.

The values of tags are in the model's unit, times are the plant's clock [s since 1970].
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    ForeignKeyConstraint,
    Integer,
    MetaData,
    String,
    Table,
    Text,
)

VERSION = 3
"""Version of the tables; another one is refused."""
metadata = MetaData()

sessions = Table(
    "sessions",
    metadata,
    Column("session", Integer, primary_key=True, autoincrement=False),
    Column("version", Integer, nullable=False),
    Column("started", String(40), nullable=False, doc="date and time of this machine"),
    Column("scenario", String(200), nullable=False),
    Column("link_file", Text, nullable=False),
    Column("sampling_s", Float, nullable=False),
    Column("resumed_session", Integer, doc="where the estimator went on from; NULL for a new start"),
    Column("resumed_cycle", BigInteger),
)


def _of_cycle(name: str, *columns: Column[object], keys: tuple[str, ...] = ()) -> Table:
    """A table with one row a cycle, or one for each further key."""
    own = [Column("session", Integer, primary_key=True), Column("cycle", BigInteger, primary_key=True)]
    further = [Column(key, String(120), primary_key=True) for key in keys]
    parent = ForeignKeyConstraint(["session", "cycle"], ["cycles.session", "cycles.cycle"])
    return Table(name, metadata, *own, *further, *columns, parent)


cycles = Table(
    "cycles",
    metadata,
    Column("session", Integer, ForeignKey("sessions.session"), primary_key=True, autoincrement=False),
    Column("cycle", BigInteger, primary_key=True, autoincrement=False),
    Column("plant_time", Float(53), doc="NULL where the plant told none"),
    Column("record_time", Float(53), doc="time of the sample in the record; NULL where there was none"),
    Column("alive", Boolean, nullable=False),
    Column("switch", Integer),
    Column("allowed", Integer, nullable=False, doc="how far a person at the page lets the link go"),
    Column("granted", Boolean, nullable=False),
    Column("in_time", Boolean, nullable=False),
    Column("written", Boolean, nullable=False),
    Column("mode", String(10), nullable=False),
    Column("asks_control", Boolean, nullable=False),
    Column("faults", Text, nullable=False),
)
tags = _of_cycle(
    "tags",
    Column("value", Float(53)),
    Column("quality", String(10), nullable=False),
    Column("source_time", Float(53)),
    Column("result", String(60), nullable=False, doc="what the checks found"),
    keys=("tag",),
)
samples = _of_cycle("samples", Column("inputs", Text), Column("outputs", Text), Column("delayed", Text))
limits = _of_cycle("limits", Column("low", Float(53)), Column("high", Float(53)), keys=("input",))
estimates = _of_cycle(
    "estimates",
    Column("status", String(30), nullable=False),
    Column("parameters", Text, nullable=False),
    Column("covariance", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("prediction", Text, nullable=False),
    Column("innovation", Text, nullable=False),
    Column("noise_std", Text, nullable=False),
    Column("colour", Text, doc="of the errors of the first record; NULL where it is not known, as `core_noise_std`"),
    Column("core_noise_std", Text),
)
decisions = _of_cycle(
    "decisions",
    Column("inputs", Text, nullable=False),
    Column("status", String(30), nullable=False),
    Column("decided_by", String(60), nullable=False),
    Column("message", Text, nullable=False),
)
writes = _of_cycle("writes", Column("value", Float(53), nullable=False), keys=("input",))
results = _of_cycle(
    "write_results",
    Column("value", Float(53)),
    Column("read_back", Float(53)),
    Column("problem", Text, nullable=False),
    keys=("input",),
)
events = _of_cycle("events", Column("text", Text, nullable=False), keys=("kind",))
"""Mode changes, what the operator did at the panel, alarms, and what discovery found."""
actions = _of_cycle(
    "actions",
    Column("person", String(80), nullable=False),
    Column("action", String(20), nullable=False),
    Column("about", Text, nullable=False),
    Column("answer", Text, nullable=False, doc="what came of it"),
    Column("asked", String(40), nullable=False, doc="date and time of this machine"),
    keys=("number",),
)
"""What persons asked for at the page, by name."""
shadows = _of_cycle(
    "shadows",
    Column("status", Text, nullable=False),
    Column("seconds", Float(53)),
    Column("parameters", Text),
    Column("covariance", Text),
    Column("state", Text),
    Column("prediction", Text),
    Column("innovation", Text),
    Column("inputs", Text, doc="what it would set"),
    Column("decision_status", String(30)),
    keys=("role",),
)
"""What ran beside the acting estimator and controller made of the sample of a cycle."""
models = _of_cycle(
    "models",
    Column("effects", Text, nullable=False, doc="what the model in use has beyond the scenario's, from this cycle on"),
    Column("prior", Text, nullable=False, doc="where its estimator started"),
    Column("person", String(80), nullable=False),
)
"""Changes of the model in use; each one before the cycle of its number."""
