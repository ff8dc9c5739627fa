"""What the command line prints: tables on standard output, a progress bar on standard error."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from adaptive_flot.console.tables import print_table
from adaptive_flot.contracts import Status
from adaptive_flot.report.compare import tables as compare_tables
from adaptive_flot.report.compare.findings import findings
from adaptive_flot.report.kit.parts import Table as Content
from adaptive_flot.report.kit.wording import number
from adaptive_flot.report.run.absorbed import absorbed
from adaptive_flot.report.run.control.softened import softened_table
from adaptive_flot.report.run.control.unsolved import unsolved_table
from adaptive_flot.report.run.inquiries import told_at_the_top
from adaptive_flot.report.run.series import cases
from adaptive_flot.runner.commands.comparison import compare_runs
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.scenario import Scenario

if TYPE_CHECKING:  # tables of runs need no discovery, whose libraries take a while to load
    from adaptive_flot.discovery.results import Verdict
    from adaptive_flot.runner.commands.estimate import RecordEstimate

PIPE_WIDTH = 80
"""Letters a line where standard output is no terminal."""


def standard_output() -> Console:
    """Standard output; a name such as `[bold]` or `data[1]` is text as any other, not a style."""
    return Console(width=None if Console().is_terminal else PIPE_WIDTH, markup=False)


@contextmanager
def progress_bar(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that advances the bar by one; nothing is drawn where standard error is no terminal."""
    console = Console(stderr=True, markup=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(label, total=total)
        yield lambda: progress.advance(task)


@contextmanager
def stage_bar(label: str) -> Iterator[Callable[[str], None]]:
    """Yield a function that shows the stage it is given and counts how often it was called; nobody knows the end."""
    console = Console(stderr=True, markup=False)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:.0f}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(label, total=None)
        yield lambda stage: progress.update(task, advance=1, description=f"{label}: {stage}")


def print_sentences(sentences: Iterable[str]) -> None:
    """Print sentences, each on lines of its own."""
    console = standard_output()
    for sentence in sentences:
        console.print(sentence, highlight=False)
    console.file.flush()


def print_verdict(verdict: Verdict, level: str = "noise") -> None:
    """Print the verdict in words and the error of each output before and after; `level` heads what it is beside."""
    console = standard_output()
    console.print(Text.assemble((verdict.word, "bold"), f": {verdict.reason}"), highlight=False)
    for note in verdict.notes:
        console.print(f"- {note}", highlight=False)
    if verdict.error:
        where = verdict.split if " " in verdict.split else f"free run, {verdict.split} split of the record"
        title = f"Root mean square error, {where}"
        rows = []
        for c in verdict.error:
            low, high = (number(100 * r, ".0f") for r in c.reduction95)
            before, after = (c.size(error, f"{error:.4g}") for error in (c.before, c.after))
            rows.append((c.output, c.unit, before, after, f"{c.noise:.4g}", f"{low} to {high}"))
        header = ("output", "unit", "before", "after", level, "reduction [%], 95 % interval")
        print_table(console, Content("", header, tuple(rows), words=2), title)
        if verdict.about_errors:
            console.print(verdict.about_errors, highlight=False)
    if verdict.experiment is not None:
        console.print(f"{verdict.experiment}", highlight=False)
    console.file.flush()


def print_fits(results: Sequence[tuple[Scenario, Sequence[Run]]]) -> None:
    """Print the fits of each scenario and estimator, median [range] over the seeds, beside the published ones."""
    keys = list(dict.fromkeys(key for _, runs in results for run in runs for key in run.fit))
    rows, told = [], []
    for scenario, runs in results:
        published = scenario.file.published.fits if scenario.file.published else {}
        several = len({run.controller for run in runs}) > 1
        for name, controller in dict.fromkeys((run.estimator, run.controller) for run in runs):
            own = [run for run in runs if (run.estimator, run.controller) == (name, controller)]
            cells = [_fit_cell([r.fit[k] for r in own if k in r.fit], published.get(name, {}).get(k)) for k in keys]
            shown = f"{name} ({controller})" if several else name
            rows.append((scenario.name, shown, str(len(own)), *cells))
            told += absorbed(shown, own)
    title = "Fit in percent: median and range over the seeds, published value in brackets"
    console = standard_output()
    print_table(console, Content("", ("scenario", "estimator", "seeds", *keys), tuple(rows), words=3), title)
    for sentence in told:
        console.print(f"- {sentence}", highlight=False)
    console.file.flush()  # a reader on a pipe sees the result before the report is drawn


def _fit_cell(values: Sequence[float], published: float | None) -> str:
    if not values:
        return ""
    text = f"{statistics.median(values):.2f}"
    if len(values) > 1:
        text += f" [{min(values):.2f}, {max(values):.2f}]"
    return text + (f"  ({published:.2f})" if published is not None else "")


def print_estimate(result: RecordEstimate) -> None:
    """Print what the record identifies, then the errors of each estimator on the fit and the test block."""
    from adaptive_flot.report.estimate.answer import NOTHING_FITTED, title
    from adaptive_flot.report.estimate.innovations import innovations_sentences

    rows = [
        (
            replay.estimator,
            e.block,
            e.output,
            e.unit,
            f"{e.one_step:.4g}",
            f"{e.free_run:.4g}",
            f"{e.ljung_box_p:.2g}",
        )
        for replay in result.replays
        for e in replay.errors
    ]
    header = ("estimator", "block", "output", "unit", "one step", "free run", "Ljung-Box p")
    console = standard_output()
    console.print(title(result), style="bold", highlight=False)
    if result.batch.status is Status.NOT_FINITE:
        console.print(NOTHING_FITTED, highlight=False)
    else:
        for e in result.batch.estimates:
            console.print(f"{e.label} = {e.value:.6g} +- {e.std:.2g} {e.unit}", highlight=False)
        console.print(f"Identifiability: {result.batch.identifiability.verdict}", highlight=False)
    if result.batch.agreement:
        console.print(f"Starts: {result.batch.agreement}", highlight=False)
    for note in result.blocks.fit.notes:
        console.print(f"- {note}", highlight=False)
    heading = f"{result.blocks.name}: root mean square errors"
    print_table(console, Content("", header, tuple(rows), words=4), heading)
    for said in innovations_sentences(result):
        console.print(said, highlight=False)


def print_closed_loop(scenario: Scenario, runs: Sequence[Run]) -> None:
    """Print what controllers and estimators earned where the scenario has economics, and how they decided."""
    if not any(run.account for run in runs):
        return
    comparison = compare_runs(scenario, runs)
    makers = (compare_tables.outcome_table, compare_tables.status_table, compare_tables.time_table)
    found = [*(make(comparison) for make in makers), unsolved_table(runs)]
    found.append(softened_table(scenario.model, runs))
    told = told_at_the_top(cases([(scenario, runs)]))
    print_comparison([table for table in found if table is not None], [*told, *findings(comparison)])


def print_comparison(tables: Sequence[Content], sentences: Sequence[str]) -> None:
    """Print the tables of a comparison; what follows from them stands below the first, which has the answer."""
    console = standard_output()
    for content in tables[:1]:
        print_table(console, content)
    for sentence in sentences:
        console.print(f"- {sentence}", highlight=False)
    for content in tables[1:]:
        print_table(console, content)
    console.file.flush()
