"""What `discover` returns of several records, or of records with a reference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from adaptive_flot.api.models import Origin
from adaptive_flot.api.shown import error_table, html_of, text_of
from adaptive_flot.discovery.hypotheses.comparison import mean_difference
from adaptive_flot.discovery.hypotheses.procedure import Comparison
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.greybox.model import Model
from adaptive_flot.targets import check_targets

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Change:
    """What has changed since reference records, or what a model lacks in several records of one process.

    Attributes
    ----------
    name
        What the records are called.
    comparison
        Everything behind the verdict: constants, hypotheses, fits.
    origin
        Where the model came from.
    sources
        Files of the records and of the model: no result is written over them.
    """

    name: str
    comparison: Comparison
    origin: Origin
    sources: tuple[Path, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """What the records say: `word`, `reason`, `effects`, `members`, `error`, and `as_dict()`."""
        return self.comparison.verdict

    @property
    def model(self) -> Model:
        """The model with what was named, fitted; with the constants of the reference else."""
        return self.comparison.model

    @cached_property
    def table(self) -> pd.DataFrame:
        """Root mean square error of each output, before and after, every stretch by a fit that did not see it."""
        return error_table(self.verdict, "usual")

    @cached_property
    def hypotheses(self) -> pd.DataFrame:
        """What was tried and came near: site, kind, fitted coefficients, gain with its 95 % interval, best first."""
        rows, count = [], len(self.comparison.blocks.edges)
        for t in self.comparison.tested:
            gain = mean_difference(self.comparison.blocks, self.comparison.null, t)
            assert t.hypothesis is not None  # what was tested is never the model as it is
            values = {c: t.fit.value(n) for c, n in zip(t.hypothesis.free, t.hypothesis.parameters, strict=True)}
            rows.append(
                {"site": t.hypothesis.site, "kind": t.hypothesis.kind, "coefficients": values,
                 "gain": count * gain.value, "low": count * gain.low, "high": count * gain.high}
            )  # fmt: skip
        return pd.DataFrame(rows)

    def plot(self, record: int = 0) -> Figure:
        """Draw measured values and the runs of the model, as it is and with the best hypothesis.

        Parameters
        ----------
        record
            Which of the new records.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it; `figure.savefig("change.png")` writes it.
        """
        from adaptive_flot.report.discovery.records import run_panels
        from adaptive_flot.report.kit.figures import time_figure

        return time_figure(run_panels(self.comparison, record))

    def report(self, path: Path | str) -> Path:
        """Write the report as one HTML page, whole or not at all; returns its path.

        Raises
        ------
        OutputError
            The file can not be written.
        """
        from adaptive_flot.report.discovery.records import write_records_report

        check_targets(self.sources, [("report", Path(path))])
        write_records_report(self.comparison, self.name, path, read=self.sources)
        return Path(path)

    def save(self, path: Path | str, *, base: str | None = None) -> Path:
        """Write the model as a model file (YAML); see `Finding.save`."""
        check_targets(self.sources, [("save", Path(path))])
        return self.origin.save(self.model, path, f"discovered in {self.name}: {self.verdict.word}", base)

    def __repr__(self) -> str:
        return text_of(self._title, self.table)

    def _repr_html_(self) -> str:
        return html_of(self._title, self.table)

    @property
    def _title(self) -> str:
        return f"{self.name}: {self.verdict.word}. {self.verdict.reason}"
