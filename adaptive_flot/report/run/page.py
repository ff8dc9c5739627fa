"""The report of scenario runs: one self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.parallel import parallel_map
from adaptive_flot.report.compare import answer as compared
from adaptive_flot.report.compare.page import comparison_parts
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Bullets, Fact, Heading, Part, Picture, Section, Text, present
from adaptive_flot.report.kit.wording import joined, seed_list, spaced
from adaptive_flot.report.run import answer, series
from adaptive_flot.report.run.chapter import Topic, spread_picture, title, topics
from adaptive_flot.report.run.control.closed_loop_figures import contenders_picture
from adaptive_flot.report.run.findings import below_published, candidates
from adaptive_flot.report.run.inquiries import told_at_the_top
from adaptive_flot.report.run.pictures import parameter_picture
from adaptive_flot.report.run.series import CaseRuns
from adaptive_flot.runner.commands.comparison import Comparison, compare_runs
from adaptive_flot.runner.commands.fingerprint import conditions
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.scenario.scenario import Scenario

Results = Sequence[tuple[Scenario, Sequence[Run]]]


def write_run_report(results: Results, path: Path | str, command: str = "", processes: int = 1) -> None:
    """Write the report of one or several scenarios as a single HTML file without external parts.

    Parameters
    ----------
    results
        Scenarios, each with its runs as `run_scenario` returns them.
    path
        File to write, whole or not at all.
    command
        Command line that made the runs, for the foot.
    processes
        Cases that are drawn at once. The page is the same with any number.
    """
    write_text(Path(path), run_report(results, command, processes))


def run_report(results: Results, command: str = "", processes: int = 1) -> str:
    """Return the page that `write_run_report` writes."""
    cases, album = series.cases(results), Album()
    loops = [(compare_runs(s, runs), [c for c in cases if c.scenario is s]) for s, runs in results if _earned(runs)]
    opened = [c for c in cases if not c.closed_loop]
    discovered = told_at_the_top(cases)
    names = list(dict.fromkeys(c.scenario.name for c in cases))
    page = Page(
        kind="Run report",
        title=compared.title(loops[0][0]) if loops else answer.title(opened),
        lead=_lead(cases, names),
        answer=[*discovered, *(s for c, _ in loops for s in compared.sentences(c)), *answer.sentences(opened)],
        facts=_facts(loops[0][0], discovered) if loops else answer.facts(opened),
        first=_first(loops, opened, album),
        sections=[*_compared(loops, album), *_sections(cases, album, processes)],
        made=made_by(command, _made(cases), dict.fromkeys(file for c in cases for file in _files(c.scenario))),
    )
    return render(page, album)


def _files(scenario: Scenario) -> list[Path]:
    """The scenario, and the records that it plays."""
    return [scenario.path, *(p for r in scenario.recorded.values() for p in r.paths(scenario.path.parent))]


def _played(scenario: Scenario) -> str:
    """Which inputs a record plays, in words; "" where none."""
    said: dict[str, list[str]] = {}
    for column, profile in scenario.recorded.items():
        said.setdefault(profile.said, []).append(column)
    names = {q.column: spaced(q.name) for q in scenario.model.inputs}
    return "".join(f" Inputs of a record ({joined(names[c] for c in played)}): {r}." for r, played in said.items())


def _earned(runs: Sequence[Run]) -> bool:
    return any(run.account for run in runs)


def _lead(cases: Sequence[CaseRuns], names: Sequence[str]) -> str:
    estimators = list(dict.fromkeys(who for case in cases for who in case.roles))
    runs = sum(len(case.runs) for case in cases)
    what = f"{runs} simulated {'run' if runs == 1 else 'runs'}"
    descriptions = dict.fromkeys(f"{case.scenario.file.description}." for case in cases)
    played = "".join(dict.fromkeys(_played(case.scenario) for case in cases))
    return f"{', '.join(names)}: {what} with {', '.join(estimators)}. {' '.join(descriptions)}{played}"


def _facts(comparison: Comparison, discovered: Sequence[str]) -> list[Fact]:
    found = Fact("Discovery in the loop", str(len(discovered)), "see the first lines") if discovered else None
    return [*compared.facts(comparison), *filter(None, [found])]


def _first(loops: Sequence[tuple[Comparison, list[CaseRuns]]], opened: Sequence[CaseRuns], album: Album) -> list[Part]:
    """What shows the answer: a matrix and a picture for each closed loop and each case in open loop."""
    parts: list[Part] = []
    for comparison, cases in loops:
        parts += present(compared.matrix(comparison), contenders_picture(cases, album))
    for case in opened:
        heading = [Heading(title(case))] if len(opened) > 1 else []
        parts += [*heading, answer.fit_matrix(case), parameter_picture(case, album)]
    return parts


def _compared(loops: Sequence[tuple[Comparison, list[CaseRuns]]], album: Album) -> list[Section]:
    several = len(loops) > 1
    return [
        Section(
            f"closed-loop-{i}",
            "Money, limit and statuses" + (f": {comparison.scenario}" if several else ""),
            "tables, distributions, paired differences",
            comparison_parts(comparison, album),
        )
        for i, (comparison, _) in enumerate(loops, 1)
    ]


def _sections(cases: Sequence[CaseRuns], album: Album, processes: int) -> list[Section]:
    """The topics of each case: a chapter each where there is one case, else one chapter a case, with theirs within."""

    def told(i: int) -> tuple[list[Topic], list[Picture]]:
        own = Album()
        return [_fits(cases[i], own), *topics(cases[i], own)], own.pictures

    sections = []
    each = parallel_map(told, range(len(cases)), processes)
    for i, (case, (found, pictures)) in enumerate(zip(cases, each, strict=True), 1):
        album.pictures += pictures
        if len(cases) == 1:
            sections += [Section(f"part-{k}", t.title, t.inside, t.parts) for k, t in enumerate(found, 1)]
            continue
        chapters = [Section(f"case-{i}-{k}", t.title, t.inside, t.parts) for k, t in enumerate(found, 1)]
        several = len({c.scenario.name for c in cases}) > 1
        sections.append(Section(f"case-{i}", title(case, several), ", ".join(case.roles), (), chapters))
    return sections


def _fits(case: CaseRuns, album: Album) -> Topic:
    """Fits beside the published ones, and what the runs themselves say."""
    parts = present(answer.fits_of(case), Bullets(answer.findings_of(case)), spread_picture(case, album))
    published = case.scenario.file.published
    if published is not None:
        parts.append(Text(f"Published values: {published.source}."))
    causes = candidates([case])
    if below_published(case) and causes:
        parts.append(Heading("Why fits may stay below the published ones"))
        parts.append(
            Text(
                "The following are candidates: scenario and model say that they are there. These runs do not say how "
                "much each of them costs."
            )
        )
        parts.append(Bullets(causes))
    return Topic("Fits", "over the seeds, beside published ones" if published else "over the seeds", parts)


def _made(cases: Sequence[CaseRuns]) -> list[tuple[str, str]]:
    lines = []
    for case in {c.scenario.name: c for c in cases}.values():
        lines.append((f"Seeds of {case.scenario.path.name}", seed_list(case.seeds)))
        lines.append((f"Conditions of {case.scenario.name}", conditions(case.scenario)))
    return lines
