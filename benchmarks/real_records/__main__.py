"""Every verdict on the real records beside the truth, and what a judge would say of it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.fitting.fit import Fit
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.discovery.since_reference.changes import find_changes
from adaptive_flot.greybox import Dataset
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.parallel import available_processes
from adaptive_flot.processes import cascaded_tanks
from benchmarks.real_records import air_handling_unit, electric_drives, heat_exchanger, lamp
from benchmarks.real_records.asked import Judged, of_measured_records, of_simulated_records, table_of
from benchmarks.real_records.folder import SHARED, has_records

LARGEST_CLASS = 2
TANK_SITES = {"upper_outflow", "lower_inflow", "lower_outflow", "level_sensor"}
"""Where the spill of the tanks acts, and the sensor, which ends at the rim of the lower one."""


def told(verdict: Verdict) -> set[str]:
    """Sites that a verdict tells; empty where it tells none."""
    if verdict.word == "class":
        return {site for site, _ in verdict.members}
    return {e.effect.site for e in verdict.effects} if verdict.word in ("named", "unnamed") else set()


def faulted_days(folder: Path) -> Iterator[Judged]:
    """The fourteen faulted days, with the clean day as reference."""
    unit = air_handling_unit
    model, days = unit.make_model(), unit.days(folder)
    for day, (part, fault) in unit.TRUTH.items():
        verdict = find_changes(model, [days[day]], [days[unit.REFERENCE]], processes=available_processes()).verdict
        sites = {unit.SAME_PART.get(site, site) for site in told(verdict)}
        yield Judged(
            f"air handling {day}", f"{part} {fault}".replace("_", " "), verdict, worth_of(part, verdict, sites)
        )


def worth_of(part: str, verdict: Verdict, sites: set[str]) -> str:
    """What a verdict is worth that tells some sites, where one part is at fault."""
    if not sites:
        return "open"
    if part not in sites or (verdict.word == "named" and sites != {part}):
        return "wrong"
    return "right" if len(sites) <= LARGEST_CLASS else "wide"


def run_on(fit: Fit, record: Dataset, seen: int) -> float:
    """Root mean square error of the first output in the rows behind the first `seen`, in a free run over all."""
    free = RecordSimulator(fit.model, record.dt).outputs(record, fit.initial_state, fit.model.parameter_values)
    return float(np.sqrt(np.nanmean((record.outputs - free)[seen:, 0] ** 2)))


def drives(folder: Path) -> Iterator[Judged]:
    """Five records of one plant together, without a reference."""
    verdict = find_changes(
        electric_drives.make_model(), electric_drives.records(folder), processes=available_processes()
    ).verdict
    right = told(verdict) == {electric_drives.TRUTH[0]} and "absolute value" in verdict.reason
    worth = "right" if right else "wrong" if told(verdict) else "open"
    yield Judged("electric drives, 5 records", " ".join(electric_drives.TRUTH), verdict, worth)


def single_records(folder: Path) -> Iterator[Judged]:
    """One record each, without a reference."""
    record = heat_exchanger.record(folder).rows(heat_exchanger.FIRST, heat_exchanger.LAST)
    found = discover(heat_exchanger.make_model(), record, processes=available_processes())
    verdict, error = found.verdict, None
    if found.before is not None and found.after is not None:
        everything = heat_exchanger.record(folder).rows(heat_exchanger.FIRST, None)
        plain, error = (run_on(fit, everything, len(record)) for fit in (found.before, found.after))
        verdict = replace(verdict, reason=f"{verdict.reason} Run on over the rest: {plain:.3f} -> {error:.3f} degC.")
    named = {(e.effect.site, e.effect.driver) for e in verdict.effects} if verdict.word == "named" else set()
    right = bool(named) and named <= {("heating", "flow"), ("residence_time", "flow")}
    worth = "right" if right else "wrong" if named else "open"
    yield Judged("heat exchanger", " ".join(heat_exchanger.TRUTH), verdict, worth, error)
    verdict = discover(lamp.make_model(), lamp.record(folder), processes=available_processes()).verdict
    yield Judged("lamp", ", ".join(lamp.TRUTH), verdict, "wrong" if verdict.word == "named" else "open")


def tanks(folder: Path) -> Iterator[Judged]:
    """The record to estimate from is searched; the other one reports, in a free run over all of it."""
    searched, other = cascaded_tanks.read_benchmark(folder / "cascaded-tanks" / "dataBenchmark.csv")
    model = cascaded_tanks.make_model()
    verdict = discover(model, searched, report_record=other, processes=available_processes()).verdict
    sites = told(verdict)
    worth = "open" if verdict.word != "named" else "right" if sites <= TANK_SITES else "wrong"
    yield Judged("cascaded tanks", "both tanks spill over their rims", verdict, worth, verdict.error[0].after)


def main(folder: Path) -> int:
    """Judge, print and count; 2 where there is nothing to judge."""
    if not has_records(folder):
        return 2
    console, judged = Console(width=160), []
    table = Table(title="Verdicts on real records", title_justify="left")
    for heading in ("record", "truth", "verdict", "worth", "s", "told"):
        table.add_column(heading)
    for group in (faulted_days, drives, single_records, tanks):
        for j in group(folder):
            judged.append(j)
            console.print(f"{j.record}: {j.verdict.word}, {j.worth}")
            table.add_row(j.record, j.truth, j.verdict.word, j.worth, f"{j.verdict.seconds:.0f}", j.verdict.reason)
    console.print(table)
    shows = [f"air handling {day}" for day in air_handling_unit.SHOWS]
    console.print(table_of([*of_measured_records(judged, shows), *of_simulated_records()]))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED))
