"""`adaptive-flot scenarios`: the shipped ones."""

from __future__ import annotations

import typer


def scenarios() -> None:
    """List the shipped scenarios with a sentence each."""
    import textwrap

    import yaml

    from adaptive_flot.runner.scenario.loading import shipped_scenarios

    shipped = shipped_scenarios()
    width = max(map(len, shipped), default=0)
    for name, path in shipped.items():
        line = f"{name:{width}}  {yaml.safe_load(path.read_text())['description']}"
        typer.echo(textwrap.fill(line, 80, subsequent_indent=" " * (width + 2)))
