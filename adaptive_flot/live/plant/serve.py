"""Run a test plant until it is over or somebody ends it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace

from adaptive_flot.errors import LinkError, near_match
from adaptive_flot.live.link_keys import MODES
from adaptive_flot.live.loop import quiet_libraries, until_stopped
from adaptive_flot.live.plant.operator import Operator
from adaptive_flot.live.plant.process import TestPlant
from adaptive_flot.live.plant.server import PlantServer, ServerPlace
from adaptive_flot.runner.scenario.checks import check_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


def serve(
    scenario: Scenario,
    place: ServerPlace,
    *,
    seed: int = 1,
    speed: float = 1.0,
    hours: float | None = None,
    switch: str = "monitor",
    auto_operator: bool = False,
    say: Callable[[str], None] = print,
) -> None:
    """Play a scenario behind a server.

    Parameters
    ----------
    scenario
        The scenario.
    place
        Where the server listens.
    seed
        Noise seed.
    speed
        How much faster than real time it runs.
    hours
        Length of the run [h]; default the scenario's. Longer than it, inputs and parameters stay where they end.
    switch
        The operator's switch at the start.
    auto_operator
        A simulated operator lets the link go to closed, and again after it has shed.
    say
        Told once where the server listens, and once when the scenario is over.

    Raises
    ------
    LinkError
        The scenario has no limits, a certificate is missing, the port is in use, or the switch has no such position.
    """
    if switch not in MODES:
        raise LinkError(f"--switch: no position {switch!r}; {near_match(switch, MODES)}")
    if hours is not None:
        rows = max(1, round(3600 * hours / scenario.dt))
        scenario = replace(scenario, file=scenario.file.model_copy(update={"duration_s": rows * scenario.dt}))
        check_scenario(scenario)
    plant = TestPlant(Realisation(scenario, seed))
    quiet_libraries()
    server = PlantServer(plant, place)
    server.operator = Operator() if auto_operator else None
    asyncio.run(_serve(server, speed, switch, say))


async def _serve(server: PlantServer, speed: float, switch: str, say: Callable[[str], None]) -> None:
    panel, _ = server.plant.panel.operated(server.state.panel, "switch", MODES[switch])
    server.state = replace(server.state, panel=panel)
    await server.start()
    name = server.plant.scenario.name
    say(f"Test plant {name}: {server.place.url}, {speed:g} times real time; Ctrl-C ends it")
    try:
        async with until_stopped() as stop:
            playing = asyncio.create_task(server.run(speed))
            ended = asyncio.create_task(stop.wait())
            await asyncio.wait({playing, ended}, return_when=asyncio.FIRST_COMPLETED)
            if playing.done():
                playing.result()
                say(f"Test plant {name}: the scenario is over")
            else:
                playing.cancel()
            ended.cancel()
    finally:
        await server.stop()
