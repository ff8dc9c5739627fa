"""The page of `import`: how good a record is, and what became of the export."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adaptive_flot.files import write_text
from adaptive_flot.records import described
from adaptive_flot.records.importing import Imported
from adaptive_flot.records.quality.quality import Quality
from adaptive_flot.records.quality.signals import SignalQuality
from adaptive_flot.report.kit.figures import p_text, time_figure
from adaptive_flot.report.kit.page import Album, Page, Picture, Table, made_by, number, render
from adaptive_flot.report.kit.strips import strip_figure
from adaptive_flot.report.kit.style import exponent, unit_text
from adaptive_flot.report.quality import series


def write_quality_report(imported: Imported, quality: Quality, path: Path | str, command: str = "") -> None:
    """Write the page as a single HTML file without external parts, whole or not at all."""
    write_text(Path(path), quality_report(imported, quality, command))


def quality_report(imported: Imported, quality: Quality, command: str = "") -> str:
    """Return the page that `write_quality_report` writes."""
    album = Album()
    name = imported.export.file.name
    contents = [
        ("record", "Record"),
        ("export", "From export to record"),
        ("signals", "Signals"),
        ("identify", "What can be identified"),
        ("map", "Map"),
    ]
    page = Page(
        title=f"Data quality: {name}",
        lead=f"{described.result(imported)}, for the model {imported.model.name}.",
        contents=contents,
        made=made_by(command, [("Model", imported.model.name), ("Export", name)]),
    )
    return render(
        "quality.html",
        page,
        findings=quality.sentences(),
        record=[_record_picture(imported, album), _status_picture(imported, album)],
        found=imported.export.found,
        converted=_converted_table(imported),
        done=_done_table(imported),
        availability=_availability_table(quality),
        behaviour=_behaviour_table(quality),
        excitation=_excitation_table(quality),
        correlation=_correlation_table(quality),
        feedback=_feedback_table(quality),
        map_text=imported.tag_map.text(),
    )


def _record_picture(imported: Imported, album: Album) -> Picture:
    caption = "The record: inputs as they acted, outputs as they were measured. A line ends at a gap."
    return album.add(time_figure(series.panels(imported)), caption, "Each quantity of the record over time")


def _status_picture(imported: Imported, album: Album) -> Picture:
    caption = "How each row came about. Of a long record each mark stands for several rows."
    return album.add(strip_figure(series.strips(imported)), caption, "Status of each quantity over time")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _converted_table(imported: Imported) -> Table:
    rows = tuple((_words(q), tag, raw, value) for q, tag, raw, value in described.converted(imported))
    return Table("Median (lowest to highest good value), as exported and in the record.", _CONVERTED, rows, words=4)


_CONVERTED = ("Quantity", "Tag", "Export", "Record")


def _done_table(imported: Imported) -> Table:
    rows = tuple(
        (_words(q), part) if k == 0 else ("", part)
        for q, text in described.done(imported)
        for k, part in enumerate(text.split("; "))
    )
    return Table("What was done with the values.", ("Quantity", "Done"), rows, words=2)


def _availability_table(quality: Quality) -> Table:
    rows = tuple(
        (
            _words(s.name),
            number(100 * s.available, ".1f"),
            *(str(s.statuses.get(word, 0)) for word in ("measured", "held", "averaged", "missing", "bad")),
            str(s.holes),
            _duration(s.longest_hole_s),
        )
        for s in quality.signals
    )
    header = (
        "Quantity",
        "Available [%]",
        "Measured",
        "Held",
        "Averaged",
        "Missing",
        "Bad",
        "Holes",
        "Longest hole [s]",
    )
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
        _words(s.name),
        unit_text(s.unit, power),
        *sizes,
        _duration(s.longest_frozen_s),
        str(s.spikes),
    )


def _excitation_table(quality: Quality) -> Table:
    rows = tuple(
        (_words(e.name), e.word, number(100 * e.share, ".2g"), str(e.moves), str(e.order)) for e in quality.excitations
    )
    caption = (
        "Each input over the longest stretch. Spread between the quantiles 0.02 and 0.98. Order of persistent "
        "excitation (Ljung 1999, section 13.2), at most 20: order 2n identifies a linear model of n-th order."
    )
    return Table(caption, ("Input", "", "Spread [% of mean]", "Moves", "Order"), rows, words=2)


def _correlation_table(quality: Quality) -> Table | None:
    rows = tuple(
        (_words(c.one), _words(c.other), number(c.r), number(c.lag * quality.step_s, "g")) for c in quality.correlations
    )
    caption = "Largest correlation coefficient over the lags; the first leads by the lag. Two inputs: without lag."
    return Table(caption, ("One", "Other", "r", "Lag [s]"), rows, words=2) if rows else None


def _feedback_table(quality: Quality) -> Table | None:
    rows = tuple(
        (
            _words(f.input),
            _words(f.output),
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
