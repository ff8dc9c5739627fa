"""Command line: `python -m benchmarks.live [--cycles N] [--network N] [--page S] [--soak H]`."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
import yaml
from rich.console import Console
from rich.table import Table
from rich.text import Text

from adaptive_flot.live.certificates import make_certificates
from adaptive_flot.live.link_file import Link, load_link
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.runner.scenario.loading import load_scenario
from benchmarks.live.lockstep import Found, Lockstep

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def main(
    cycles: Annotated[
        int, typer.Option(min=1, help="Cycles in one process; 0.1 million take most of an hour.")
    ] = 10_000,
    scenario: Annotated[str, typer.Option(help="Shipped scenario with limits.")] = "closed_loop_drift",
    seed: Annotated[int, typer.Option(min=0, help="Of the faults.")] = 1,
    network: Annotated[int, typer.Option(min=0, help="Rounds of kills over OPC UA, a minute each.")] = 0,
    page: Annotated[float, typer.Option(min=0, help="Seconds of tag to pixel in Chromium, at each speed.")] = 0,
    soak: Annotated[float, typer.Option(min=0, help="Simulated hours with the page open in Chromium.")] = 0,
    out: Annotated[Path, typer.Option(help="Folder of the figures.")] = Path("results/live"),
) -> None:
    """Cycles of the live link under faults: unsafe writes, lost rows, bumps, times."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        make_certificates(folder / "certificates")
        found = Lockstep(long_link(folder, scenario, cycles), folder, seed).run(cycles)
        figures = lockstep_figures(found)
        if network:
            from benchmarks.live.network import network_figures

            figures |= network_figures(folder, scenario, network)
        if page or soak:
            from benchmarks.live.page import latency_figures
            from benchmarks.live.soak import soak_figures

            for speed in (1.0, 5.0) if page else ():
                figures |= latency_figures(folder, scenario, speed, page)
            figures |= soak_figures(folder, scenario, soak, print) if soak else {}
    table = Table("figure", "measured")
    for what, measured in figures.items():
        table.add_row(Text(what), Text(str(measured)))
    Console(width=120).print(table)
    out.mkdir(parents=True, exist_ok=True)
    (out / "live.json").write_text(json.dumps(figures, indent=2) + "\n")


def long_link(folder: Path, name: str, cycles: int) -> Link:
    """A link to a scenario that is as long as the run."""
    loaded = load_scenario(name)
    content = yaml.safe_load(link_text(loaded, "opc.tcp://127.0.0.1:4840", folder / "certificates"))
    (folder / "link.yaml").write_text(yaml.safe_dump(content))
    link = load_link(folder / "link.yaml")
    file = link.scenario.file.model_copy(update={"duration_s": (cycles + 1) * link.scenario.dt})
    return link.model_copy(update={"scenario": replace(link.scenario, file=file)})


def lockstep_figures(found: Found) -> dict[str, object]:
    """Figures of a run in one process, by name."""
    audit = found.audit
    return {
        "cycles": audit.cycles,
        "cycles by mode": dict(audit.modes),
        "faults": found.counted,
        "sessions": found.sessions,
        "writes that the plant took": audit.writes,
        "unsafe writes": sum(audit.unsafe.values()),
        "unsafe writes, by reason": dict(audit.unsafe),
        "writes that the plant refused": found.refused,
        "rows lost, doubled": f"{found.rows.lost}, {found.rows.doubled} of {found.rows.cycles} cycles",
        "largest bump at a change of mode [rate limits]": round(audit.bump, 6),
        "sheddings for bad cycles; cycles each, most": f"{len(audit.shed_cycles)}; {max(audit.shed_cycles, default=0)}",
        **times(found),
        "load of the machine, least and most": "{:.1f} and {:.1f}".format(*found.load),
        "memory growth after the first 1000 cycles [MB]": round(found.grown_mb, 1),
    }


def times(found: Found) -> dict[str, object]:
    """Times of cycles with storage, by the clock and of the processor, with and without a solve."""
    figures: dict[str, object] = {}
    kinds = {
        "cycle with storage": found.solves | True,
        "... that solves": found.solves,
        "... that does not": ~found.solves,
    }
    for kind, rows in kinds.items():
        for column, what in enumerate(("by the clock", "of the processor")):
            if rows.any():
                milliseconds = 1000 * found.seconds[rows, column]
                figures[f"{kind}, {what}: median and 99 % [ms]"] = quantiles(milliseconds)
    return figures


def quantiles(milliseconds: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    """Median and 99 %."""
    return " and ".join(f"{q:.1f}" for q in np.percentile(milliseconds, [50, 99]))


app()
