"""The page of a study: many runs, and what they say together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.report.compare import answer as compared
from adaptive_flot.report.compare.distribution import distribution_picture
from adaptive_flot.report.compare.page import sections as compared_sections
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Part, Section, present
from adaptive_flot.report.kit.wording import seed_list
from adaptive_flot.report.sweep import answer
from adaptive_flot.report.sweep.seeds import Failed, worst_table
from adaptive_flot.runner.commands.comparison import Comparison, compare, seeds_of
from adaptive_flot.runner.commands.runs.runs_table import read_runs
from adaptive_flot.studies.study_file import Study


def write_sweep_report(study: Study, folder: Path, path: Path, command: str = "", read: Sequence[Path] = ()) -> None:
    """Write the page of a finished study as a single HTML file, whole or not at all.

    Parameters
    ----------
    study
        The study.
    folder
        Its folder, with the table of runs.
    path
        File to write.
    command
        Command line that made it, for the foot.
    read
        Files that the study was read from; their hashes stand in the foot.
    """
    write_text(path, sweep_report(study, folder, command, read))


def sweep_report(study: Study, folder: Path, command: str = "", read: Sequence[Path] = ()) -> str:
    """Return the page that `write_sweep_report` writes."""
    table = read_runs([folder])
    failed, album = Failed.of(table), Album()
    done = table[table["outcome"] != "failed"]
    comparisons = compare(done) if len(done) else []
    page = Page(
        kind="Study",
        title=answer.title(comparisons) if comparisons else "All runs failed",
        lead=_lead(study, comparisons, len(table)),
        answer=answer.sentences(comparisons, failed) if comparisons else [failed.sentence],
        facts=answer.facts(comparisons, len(table), failed) if comparisons else [],
        first=_first(comparisons, album),
        sections=_sections(comparisons, failed, album),
        made=made_by(command, [("Study", study.name)], [*read, folder / "runs.parquet"]),
    )
    return render(page, album)


def _lead(study: Study, comparisons: Sequence[Comparison], runs: int) -> str:
    text = f"{study.name}: {study.description.rstrip('.')}. {runs} runs"
    return f"{text}, {seed_list(seeds_of(comparisons))}." if comparisons else f"{text}."


def _first(comparisons: Sequence[Comparison], album: Album) -> list[Part]:
    """What shows the answer: a matrix, and the distributions."""
    if not comparisons:
        return []
    table = compared.matrix(comparisons[0]) if len(comparisons) == 1 else answer.overview(comparisons)
    return present(table, distribution_picture(comparisons, album))


def _sections(comparisons: Sequence[Comparison], failed: Failed, album: Album) -> list[Section]:
    several = len(comparisons) > 1
    found = [
        s for i, c in enumerate(comparisons, 1) for s in compared_sections(c, i, several, album, distribution=several)
    ]
    worst = [table for c in comparisons if (table := worst_table(c)) is not None]
    if worst:
        found.append(Section("worst", "Worst seeds", "where to look first", worst))
    lost = failed.table()
    return [*([Section("failed", "Failed runs", "by message", [lost])] if lost else []), *found]
