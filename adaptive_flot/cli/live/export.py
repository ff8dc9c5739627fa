"""`adaptive-flot export`: what a live link has stored, as a record."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.targets import check_targets


def export(
    link: Annotated[Path, typer.Argument(help="Link file, which names database and scenario.")],
    out: Annotated[Path | None, typer.Option("--out", help="Record to write, .csv or .parquet.")] = None,
    begin: Annotated[datetime | None, typer.Option("--from", help="First time (UTC, plant's clock).")] = None,
    end: Annotated[datetime | None, typer.Option("--to", help="Last time (UTC, plant's clock).")] = None,
    replay: Annotated[bool, typer.Option("--replay", help="Replay the session and compare it to the bit.")] = False,
    shadows: Annotated[bool, typer.Option("--shadows", help="Compare what ran in shadow with what acted.")] = False,
    session: Annotated[int | None, typer.Option(min=1, help="Session to replay or compare; default the last.")] = None,
) -> None:
    """Write what a live link has stored as a record for `discover`, `estimate` and `run`."""
    from adaptive_flot.errors import LinkError, located
    from adaptive_flot.greybox.data.tables import check_table_path, write_table
    from adaptive_flot.live.link_file import load_link
    from adaptive_flot.live.store.memory import open_database
    from adaptive_flot.live.store.record import chosen_stretch, record_table, stretches

    loaded = load_link(link)
    if out is None and not replay and not shadows:
        raise LinkError("export: nothing to do; give --out RECORD.csv, --replay or --shadows")
    if out is not None:
        check_targets([link, loaded.scenario.path], [("--out", out)])
        check_table_path(out)
    with located(link):
        engine = open_database(loaded.file.database, link.parent)
    if out is not None:
        first, last = (None if t is None else t.replace(tzinfo=UTC).timestamp() for t in (begin, end))
        known = stretches(engine, loaded)
        table = record_table(loaded, chosen_stretch(loaded, known, first, last), first, last)
        write_table(table, out)
        whole = "" if len(known) < 2 else f", of {len(known)} stretches between long gaps"
        typer.echo(f"{len(table)} rows: {out}{whole}")
    if shadows:
        from rich.console import Console
        from rich.table import Table

        from adaptive_flot.live.store.shadows import compare

        table_of = Table("in shadow", "quantity", "rows", "acting", "in shadow")
        for one in compare(engine, loaded, session):
            table_of.add_row(one.role, one.quantity, str(one.rows), f"{one.acting:.4g}", f"{one.shadow:.4g}")
        Console(width=120).print(table_of)
    if replay:
        from adaptive_flot.live.link.replay import replay as replay_session

        found = replay_session(engine, loaded, session)
        counted = f"{found.cycles} cycles, {found.estimates} estimates, {found.decisions} decisions"
        for words in found.words:
            typer.echo(words)
        same = "all the same to the bit" if not found.different else f"{found.different} cycles differ"
        typer.echo(f"Session {found.session}: {counted}: {same}")
