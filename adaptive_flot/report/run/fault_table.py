"""Table of the faults that a scenario injects: when, and how often they changed something."""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.runner.scenario.faults import Fault, Stuck


def fault_table(case: CaseRuns) -> Table | None:
    """Injected faults with the intervals in which each acted, over all runs; None where a scenario has none."""
    faults = case.scenario.file.faults
    if not faults:
        return None
    names = list(dict.fromkeys(_name(case, fault) for fault in faults))
    rows = []
    for name in names:
        entries = [fault for fault in faults if _name(case, fault) == name]
        counts = [sum(run.fault_counts.get(name, 0) for run in case.of(who)) for who in case.roles]
        rows.append((name.replace("_", " "), _times(entries), *(f"{n:,}".replace(",", " ") for n in counts)))
    caption = (
        "Injected faults: sampling intervals of all runs in which each changed something; of a failing solver, "
        "optimisations that were made to fail."
    )
    return Table(caption, ("Fault", "Time [s]", *case.roles), tuple(rows), words=2)


def _name(case: CaseRuns, fault: Fault) -> str:
    if isinstance(fault, Stuck):
        names = {q.column: q.name for q in case.scenario.model.inputs}
        return f"{fault.fault} {names[fault.input]}"
    output = getattr(fault, "output", "")
    return f"{fault.fault} {output}".strip()


def _times(entries: Sequence[Fault]) -> str:
    ends = ("end" if f.to_s is None else number(f.to_s, "g") for f in entries)
    return ", ".join(f"{number(f.from_s, 'g')} to {end}" for f, end in zip(entries, ends, strict=True))
