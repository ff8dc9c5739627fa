"""`adaptive-flot scenarios`: the shipped ones."""

from __future__ import annotations

import typer


def scenarios() -> None:
    """List the shipped scenarios with a line each."""
    import yaml

    from adaptive_flot.runner.scenario.loading import shipped_scenarios

    shipped = shipped_scenarios()
    width = max(map(len, shipped), default=0)
    for name, path in shipped.items():
        typer.echo(f"{name:{width}}  {yaml.safe_load(path.read_text())['description']}")
