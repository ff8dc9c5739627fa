"""The report of `discover` on several records: what has changed, the runs before and after, and what was tried."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from adaptive_flot.charts.palette import GREY
from adaptive_flot.charts.plotdata import Chart, Panel, Role, Trace
from adaptive_flot.discovery.hypotheses.comparison import mean_difference
from adaptive_flot.discovery.hypotheses.families import Hypothesis
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.hypotheses.wording import words_of
from adaptive_flot.discovery.since_reference.searched_change import REPORT_ROWS, SEARCHED
from adaptive_flot.files import write_text
from adaptive_flot.report.discovery.answer import WORDS, error_facts, made_from, title_of
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Fact, Part, Picture, Section, Table, Text
from adaptive_flot.report.kit.wording import number

MOST_RECORDS = 5
"""Records whose runs are drawn."""
MOST_HYPOTHESES = 12
TITLES = {
    "none": "nothing has changed that the records show",
    "named": "what has changed, by name",
    "class": "one of a few parts has changed",
    "abstain": "something has changed, and the records do not tell what",
    "insufficient": "the records do not say enough",
}
WITHOUT_REFERENCE = {
    "none": "no effect is missing",
    "named": "a missing effect, by name",
    "class": "one of a few effects is missing",
    "abstain": "something is missing, and the records do not tell what",
    "insufficient": "the records do not say enough",
}


def write_records_report(
    comparison: Comparison, name: str, path: Path | str, command: str = "", read: Sequence[Path] = ()
) -> None:
    """Write the report as a single HTML file without external parts.

    Parameters
    ----------
    comparison
        What `compare` returned.
    name
        What the records are called.
    path
        File to write, whole or not at all.
    command
        Command line that made it, for the foot.
    read
        Files whose hashes the foot shows.

    Raises
    ------
    OutputError
        The file can not be written.
    """
    write_text(Path(path), records_report(comparison, name, command, read))


def records_report(comparison: Comparison, name: str, command: str = "", read: Sequence[Path] = ()) -> str:
    """Return the page that `write_records_report` writes."""
    verdict, album = comparison.verdict, Album()
    titles = TITLES if comparison.referred else WITHOUT_REFERENCE
    old = [r.name for r in comparison.calibration.rows.records] if comparison.referred else []
    pictures = _runs(comparison, album)
    tried: list[Part] = [Text(_tried(comparison)), *([_hypotheses(comparison)] if comparison.tested else [])]
    page = Page(
        kind="Discovery report",
        title=title_of(verdict, titles) if verdict.word != "named" else verdict.reason.partition(". ")[0].rstrip("."),
        lead=f"Records: {name}." + (f" Reference: {', '.join(old)}." if old else ""),
        answer=[verdict.reason, *verdict.notes],
        facts=[Fact("Verdict", verdict.word, WORDS[verdict.word]), *error_facts(verdict.error)],
        first=pictures[:1],
        sections=[
            *([Section("records", "The other records", "measured and modelled", pictures[1:])] if pictures[1:] else []),
            Section("errors", "Error before and after", "with 95 % intervals", [_errors(comparison)]),
            Section("hypotheses", "What was tried", f"{comparison.tried} hypotheses", tried),
            Section("constants", "Constants", "before and after", [_constants(comparison)]),
        ],
        made=made_by(
            command,
            made_from(comparison.calibration.model.name, verdict.seconds, comparison.rows.records),
            read,
        ),
    )
    return render(page, album)


def run_panels(comparison: Comparison, which: int) -> list[Panel]:
    """Measured values and the model's runs of one record, a panel an output."""
    rows, best, panels = comparison.rows, comparison.judged.best, []
    record = rows.records[which]
    for j, c in enumerate(rows.columns):
        q, measured = comparison.model.outputs[c], record.outputs[:, c]
        before = measured - comparison.null.fit.errors[which][:, j]
        traces = [
            Trace("measured", record.time, measured, Role.TRUTH),
            Trace("model as it is", record.time, before, Role.CONSTANT, GREY),
        ]
        if best is not None and best.hypothesis is not None:
            label = f"with {_told(comparison, best.hypothesis)}"
            after = measured - best.fit.errors[which][:, j]
            traces.append(Trace(label, record.time, after, Role.ESTIMATE))
        panels.append(Panel(q.name.replace("_", " "), q.unit, tuple(traces)))
    return panels


def _told(comparison: Comparison, best: Hypothesis) -> str:
    """What is told, for a line of the picture: a hypothesis of the whole record, or what the search has found."""
    found = comparison.verdict.effects
    if best.kind != SEARCHED:
        return best.label.replace("_", " ")
    return " and ".join(f"{e.effect.site} by {e.effect.driver}".replace("_", " ") for e in found)


def _runs(comparison: Comparison, album: Album) -> list[Picture]:
    pictures = []
    for i, record in enumerate(comparison.rows.records[:MOST_RECORDS]):
        caption = f"Record {record.name}: measured values and free runs of the model."
        chart = Chart(tuple(run_panels(comparison, i)))
        pictures.append(album.chart(chart, caption, f"Measured and modelled outputs of {record.name}"))
    return pictures


def _errors(comparison: Comparison) -> Table:
    cells = []
    for c in comparison.verdict.error:
        low, high = (number(100 * r, ".0f") for r in c.reduction95)
        cells.append((c.output, c.unit, f"{c.before:.4g}", f"{c.after:.4g}", f"{c.noise:.4g}", f"{low} to {high}"))
    usual = "on the reference" if comparison.referred else "of the plain fit"
    header = ("output", "unit", "before", "after", f"usual {usual}", "reduction [%], 95 % interval")
    split = comparison.verdict.split
    by = "; every stretch by a fit that did not see it" if split != REPORT_ROWS else ""
    caption = f"Root mean square error, {split}{by}"
    return Table(caption, header, tuple(cells), 2)


def _tried(comparison: Comparison) -> str:
    told = len(comparison.tested)
    return (
        f"{comparison.tried} hypotheses were fitted, one at a time, with the constants free within what is known of "
        f"them. The {told} that came near to the best one were judged on stretches that did not fit them. Gain: how "
        "much less the errors cost than those of the model as it is. One that lies within 15 % of the best gain, or "
        "whose difference may be zero, is not told apart from it."
    )


def _hypotheses(comparison: Comparison) -> Table:
    cells = []
    for t in comparison.tested[:MOST_HYPOTHESES]:
        gain = mean_difference(comparison.blocks, comparison.null, t)
        scale = len(comparison.blocks.edges)
        low, high = number(scale * gain.low, ".1f"), number(scale * gain.high, ".1f")
        assert t.hypothesis is not None  # the model as it is is not among the tested
        words = words_of(comparison.calibration.model, t.hypothesis, t.fit.value)
        cells.append((f"{words[0].upper()}{words[1:]}", number(scale * gain.value, ".1f"), f"{low} to {high}"))
    return Table("Hypotheses, best first", ("hypothesis", "gain", "95 % interval"), tuple(cells))


def _constants(comparison: Comparison) -> Table:
    constants = comparison.calibration.constants
    std = np.sqrt(np.sum(constants.root**2, axis=1))
    best = comparison.judged.best or comparison.null
    cells = []
    for name, mean, s in zip(constants.names, constants.mean, std, strict=True):
        p = comparison.calibration.model.parameters[comparison.calibration.model.index("parameters", name)]
        cells.append((p.label, p.unit, f"{mean:.4g}", f"{s:.3g}", f"{best.fit.value(name):.4g}"))
    source = "the reference" if comparison.referred else "all records"
    header: Sequence[str] = ("constant", "unit", f"by {source}", "standard deviation", "on the new records")
    return Table("Constants of the model", tuple(header), tuple(cells), 2)
