"""`adaptive-flot live`: estimator and controller beside a running plant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def live(
    link: Annotated[Path, typer.Argument(help="Link file; `serve-plant --write-link` writes one to start from.")],
    cycles: Annotated[int | None, typer.Option(min=1, help="Number of cycles; default until it is ended.")] = None,
) -> None:
    """Run an estimator and a controller beside a plant, over OPC UA."""
    from adaptive_flot.live.link_file import load_link
    from adaptive_flot.live.program import live as run_live

    run_live(load_link(link), typer.echo, cycles)
