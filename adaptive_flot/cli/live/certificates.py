"""`adaptive-flot certificates`: certificates, keys and passwords for a live link on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def certificates(
    out: Annotated[Path, typer.Option("--out", help="Folder to write them to.")] = Path("certificates"),
    host: Annotated[
        list[str] | None, typer.Option(help="Name or address of the plant's server (repeatable); default this machine.")
    ] = None,
) -> None:
    """Make certificates, keys and passwords for a test plant, a link and an operator."""
    from adaptive_flot.live.certificates import make_certificates

    files = make_certificates(out, tuple(host or ("localhost", "127.0.0.1")))
    typer.echo(f"{len(files)} files: {out}. Keep *.pem, *.password and *.token to yourself.")
