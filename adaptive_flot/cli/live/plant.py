"""`adaptive-flot serve-plant`: a scenario behind an OPC UA server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from adaptive_flot.targets import check_new, check_targets


def serve_plant(
    scenario: Annotated[str, typer.Argument(help="Scenario file, or the name of a shipped scenario, with limits.")],
    certificates: Annotated[Path, typer.Option(help="Folder of `certificates`.")] = Path("certificates"),
    speed: Annotated[float, typer.Option(min=0.01, max=1000, help="How much faster than real time.")] = 1.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Noise seed.")] = 1,
    hours: Annotated[float | None, typer.Option(min=0.01, help="Length; default the scenario's.")] = None,
    host: Annotated[str, typer.Option(help="Address to listen at; another one opens the plant to the network.")] = (
        "127.0.0.1"
    ),
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen at.")] = 4840,
    switch: Annotated[str, typer.Option(help="Operator's switch at the start: off, monitor, advisory, closed.")] = (
        "monitor"
    ),
    auto_operator: Annotated[
        bool, typer.Option("--auto-operator", help="Simulate an operator who lets the link go to closed.")
    ] = False,
    page: Annotated[int | None, typer.Option(min=0, max=65535, help="Port of the page, for the link file.")] = 8050,
    write_link: Annotated[Path | None, typer.Option("--write-link", help="Write a link file for this plant.")] = None,
) -> None:
    """Play a scenario as a plant with an OPC UA server: a test plant for `live`."""
    from adaptive_flot.files import write_text
    from adaptive_flot.live.plant.link_text import link_text
    from adaptive_flot.live.plant.serve import serve
    from adaptive_flot.live.plant.server import ServerPlace
    from adaptive_flot.runner.scenario.loading import load_scenario

    loaded = load_scenario(scenario)
    place = ServerPlace(certificates.absolute(), host, port)
    if write_link is not None:
        check_targets([loaded.path], [("--write-link", write_link)])
        text = link_text(loaded, place.url, certificates.absolute(), speed=speed, page=page)
        check_new(write_link, "--write-link", text)
        write_text(write_link, text)
        typer.echo(f"Link file: {write_link}")
    serve(
        loaded,
        place,
        seed=seed,
        speed=speed,
        hours=hours,
        switch=switch,
        auto_operator=auto_operator,
        say=typer.echo,
    )
