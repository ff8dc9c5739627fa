"""The page of `import`: how good a record is, and what became of the export."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adaptive_flot.charts.plotdata import Chart
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.files import write_text
from adaptive_flot.records import described
from adaptive_flot.records.clean import FATES
from adaptive_flot.records.grid import CONSTANT, STATUSES
from adaptive_flot.records.importing import Imported
from adaptive_flot.records.quality.quality import FEWEST_ROWS, Quality
from adaptive_flot.records.quality.signals import SignalQuality
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.kit.page import Page, made_by, render
from adaptive_flot.report.kit.parts import Bullets, Code, Fact, Part, Picture, Section, Table, Text, present
from adaptive_flot.report.kit.wording import joined, number, p_text, spaced
from adaptive_flot.report.quality import series


def write_quality_report(imported: Imported, quality: Quality, path: Path | str, command: str = "") -> None:
    """Write the page as a single HTML file without external parts, whole or not at all."""
    write_text(Path(path), quality_report(imported, quality, command))


def quality_report(imported: Imported, quality: Quality, command: str = "") -> str:
    """Return the page that `write_quality_report` writes."""
    album = Album()
    name = imported.export.file.name
    first, *said = (_in_words(imported, sentence) for sentence in quality.sentences())
    page = Page(
        kind="Data quality",
        title=_title(quality),
        lead=f"Export {name}, for the model {imported.model.name}: {described.result(imported)}.",
        answer=[said[0]] if said else [first],
        facts=_facts(imported, quality),
        first=[Bullets([*said[1:], first]), _record_picture(imported, album)],
        sections=[
            Section("export", "From export to record", "tags, units, what was left out", _export(imported)),
            Section("signals", "Signals", "availability, noise, drift, frozen values", _signals(quality)),
            Section("identify", "What can be identified", "moves, correlation, feedback", _identify(quality)),
            Section(
                "map",
                "Map",
                "for the next export of these tags",
                [Text("Give it with --map for the next export of these tags."), Code(imported.tag_map.text())],
            ),
        ],
        made=made_by(command, [("Model", imported.model.name), ("Export", name)], [imported.export.file]),
    )
    return render(page, album)


def _in_words(imported: Imported, sentence: str) -> str:
    """A sentence with the names of quantities as words."""
    for c in imported.cleaned:
        sentence = sentence.replace(c.quantity.name, spaced(c.quantity.name))
    return sentence


def _title(quality: Quality) -> str:
    """Whether the record will do, in a few words."""
    worst = min(quality.signals, key=lambda s: s.available)
    moving = [e.name for e in quality.excitations if e.word == "moves"]
    if max(quality.stretches) < FEWEST_ROWS:
        return f"Too short to search: the longest stretch has {max(quality.stretches)} rows"
    if not moving:
        return "No input moves: no dependence on an input can be told"
    if worst.available < 0.9:
        return f"Usable, with gaps: {spaced(worst.name)} has a value in {100 * worst.available:.0f} % of the rows"
    return f"Usable: {joined(map(spaced, moving))} {'move' if len(moving) > 1 else 'moves'}"


def _facts(imported: Imported, quality: Quality) -> list[Fact]:
    worst = min(quality.signals, key=lambda s: s.available)
    left_out = sum(c.count(f) for c in imported.cleaned for f in FATES[1:])
    moving = sum(e.word == "moves" for e in quality.excitations)
    closed = sum(f.closed for f in quality.feedbacks)
    longest = f"longest stretch {max(quality.stretches)}" if len(quality.stretches) > 1 else "in one stretch"
    share = 100 * worst.available
    return [
        Fact("Rows", str(quality.rows), f"one every {quality.step_s:g} s; {longest}"),
        Fact("Least available", f"{share:.1f} %", spaced(worst.name), "bad" if share < 90 else "good"),
        Fact("Values left out", str(left_out), "bad, frozen, spikes, out of range", ""),
        Fact("Inputs that move", f"{moving} of {len(quality.excitations)}", "", "good" if moving else "bad"),
        Fact("Feedback", "closed loop" if closed else "none seen", "in past values", "bad" if closed else ""),
    ]


def _export(imported: Imported) -> list[Part]:
    return present(Bullets(imported.export.found), _converted_table(imported), _done_table(imported))


def _signals(quality: Quality) -> list[Part]:
    return [_availability_table(quality), _behaviour_table(quality)]


def _identify(quality: Quality) -> list[Part]:
    return present(_excitation_table(quality), _correlation_table(quality), _feedback_table(quality))


def _record_picture(imported: Imported, album: Album) -> Picture:
    chart = Chart(tuple(series.panels(imported)), tuple(series.strips(imported)))
    caption = (
        "The record: inputs as they acted, outputs as they were measured; a line ends at a gap. Below, how each row "
        "came about; of a long record each mark stands for several rows."
    )
    return album.chart(chart, caption, "Each quantity of the record over time, and how each row came about")


def _converted_table(imported: Imported) -> Table:
    rows = tuple((spaced(q), tag, raw, value) for q, tag, raw, value in described.converted(imported))
    return Table("Median (lowest to highest good value), as exported and in the record.", _CONVERTED, rows, words=4)


_CONVERTED = ("Quantity", "Tag", "Export", "Record")


def _done_table(imported: Imported) -> Table:
    rows = tuple(
        (spaced(q), part) if k == 0 else ("", part)
        for q, text in described.done(imported)
        for k, part in enumerate(text.split("; "))
    )
    return Table("What was done with the values.", ("Quantity", "Done"), rows, words=2)


def _availability_table(quality: Quality) -> Table:
    words = [w for w in STATUSES if w != STATUSES[CONSTANT] or any(w in s.statuses for s in quality.signals)]
    rows = tuple(
        (
            spaced(s.name),
            number(100 * s.available, ".1f"),
            *(str(s.statuses.get(word, 0)) for word in words),
            str(s.holes),
            _duration(s.longest_hole_s),
        )
        for s in quality.signals
    )
    header = ("Quantity", "Available [%]", *(w.capitalize() for w in words), "Holes", "Longest hole [s]")
    caption = "Rows by how they came about. A hole is a time of more than 2.5 usual steps without a good value."
    return Table(caption, header, rows)


def _behaviour_table(quality: Quality) -> Table:
    rows = tuple(_behaviour(s) for s in quality.signals)
    caption = (
        "Spread: between the quantiles 0.05 and 0.95. Noise: standard deviation from row to row (von Neumann 1941, "
        "with the median). Drift: slope of Theil and Sen (1968) times the duration. Frozen: longest time of 30 and "
        "more equal values where the signal else changes. Spikes: Hampel's filter, 9 neighbours."
    )
    header = ("Quantity", "Unit", "Median", "Spread", "Noise", "Drift", "Frozen [s]", "Spikes")
    return Table(caption, header, rows, words=2)


def _behaviour(s: SignalQuality) -> tuple[str, ...]:
    power = exponent(np.array([s.low, s.high]))
    sizes = (number(v * 10.0**-power, ".4g") for v in (s.middle, s.spread, s.noise, s.drift))
    return (
        spaced(s.name),
        unit_text(s.unit, power),
        *sizes,
        _duration(s.longest_frozen_s),
        str(s.spikes),
    )


def _excitation_table(quality: Quality) -> Table:
    rows = tuple(
        (spaced(e.name), e.word, number(100 * e.share, ".2g"), str(e.moves), str(e.order)) for e in quality.excitations
    )
    caption = (
        "Each input over the longest stretch. Spread between the quantiles 0.02 and 0.98. Order of persistent "
        "excitation (Ljung 1999, section 13.2), at most 20: order 2n identifies a linear model of n-th order."
    )
    return Table(caption, ("Input", "", "Spread [% of mean]", "Moves", "Order"), rows, words=2)


def _correlation_table(quality: Quality) -> Table | None:
    rows = tuple(
        (spaced(c.one), spaced(c.other), number(c.r), number(c.lag * quality.step_s, "g")) for c in quality.correlations
    )
    caption = "Largest correlation coefficient over the lags; the first leads by the lag. Two inputs: without lag."
    return Table(caption, ("One", "Other", "r", "Lag [s]"), rows, words=2) if rows else None


def _feedback_table(quality: Quality) -> Table | None:
    rows = tuple(
        (
            spaced(f.input),
            spaced(f.output),
            number(100 * f.share, ".1f"),
            p_text(f.p_value),
            "yes" if f.closed else "no",
        )
        for f in quality.feedbacks
    )
    caption = (
        "Is an input set from an output? Share of the input's moves, not explained by its own last 5 rows, that the "
        "output's last 5 rows explain; F test (Granger 1969, Caines and Chan 1975). Yes: more than 5 % and p < 0.001. "
        "A feedback within one row is not seen."
    )
    return Table(caption, ("Input", "Output", "Share [%]", "p", "Feedback"), rows, words=2) if rows else None


def _duration(value: float) -> str:
    return "–" if value == 0 else f"{value:.4g}"
