"""Controllers and estimators side by side: spread over the seeds, and share of what perfect knowledge would gain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from adaptive_flot.described import Described
from adaptive_flot.errors import ResultError
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.commands.runs.run_files import run_summary
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.runs_table import run_rows
from adaptive_flot.runner.scenario.scenario import Scenario

FIXED, ORACLE = "fixed", "oracle"
"""Names of the estimators between which the gain of knowing the parameters lies."""
SMALLEST_GAIN = 1e-3
"""Gain of the oracle, over what fixed parameters reach, from which a share of it means something."""
GAINS = ("value_cu_h", "recovery")
"""Columns of which the share of the oracle's gain is taken."""


@dataclass(frozen=True)
class SeedSpread:
    """Median and range of the finite values over the seeds, and how many are not finite."""

    median: float
    low: float
    high: float
    not_finite: int = 0

    @classmethod
    def of(cls, values: FloatArray) -> SeedSpread:
        """SeedSpread of values (S,); NaN throughout if none is finite."""
        finite = values[np.isfinite(values)]
        if not finite.size:
            return cls(np.nan, np.nan, np.nan, values.size)
        return cls(float(np.median(finite)), float(finite.min()), float(finite.max()), values.size - finite.size)


@dataclass(frozen=True, repr=False)
class Contender(Described):
    """A controller with an estimator; its runs, one a seed.

    Attributes
    ----------
    controller, estimator
        What ran.
    result
        The result it is of, where two results hold the same seeds of this controller and estimator; else "".
    runs
        Rows of the table of runs, indexed by seed.
    """

    controller: str
    estimator: str
    result: str
    runs: pd.DataFrame

    def described(self) -> dict[str, object]:
        """Who ran how often; see `Described`."""
        return {"controller": self.controller, "estimator": self.estimator, "runs": len(self.runs)}

    @property
    def label(self) -> str:
        """Name in figures and sentences: "economic_mpc, rpem"."""
        return f"{self.controller}, {self.estimator}" + (f" ({self.result})" if self.result else "")

    @property
    def seeds(self) -> list[int]:
        """Seeds in order."""
        return [int(seed) for seed in self.runs.index]

    def has(self, column: str) -> bool:
        """Whether any run has a value in a column."""
        return column in self.runs and bool(self.runs[column].notna().any())

    def values(self, column: str) -> FloatArray:
        """Values over the seeds (S,), NaN where there is none."""
        if column not in self.runs:
            return np.full(len(self.runs), np.nan)
        return np.asarray(self.runs[column].to_numpy(dtype=float, na_value=np.nan))

    def spread(self, column: str) -> SeedSpread:
        """Median and range over the seeds."""
        return SeedSpread.of(self.values(column))

    @property
    def metrics(self) -> list[str]:
        """Columns with numbers that are spread over the seeds: all but names, settings and counts by status."""
        apart = ("status_", "control_", "decided_", "fault_", "grade_limit")
        columns = self.runs.select_dtypes("number").columns
        return [str(c) for c in columns if not str(c).startswith(apart) and self.has(str(c))]

    def counts(self, prefix: str) -> dict[str, int]:
        """Sum over the runs of the counts `<prefix>_<name>`, largest first."""
        totals = {
            str(c).removeprefix(f"{prefix}_"): int(np.nansum(self.values(str(c))))
            for c in self.runs.columns
            if str(c).startswith(f"{prefix}_")
        }
        return {name: n for name, n in sorted(totals.items(), key=lambda item: -item[1]) if n}


@dataclass(frozen=True, repr=False)
class Comparison(Described):
    """The contenders of one scenario.

    Attributes
    ----------
    scenario
        Its name; several names where copies ask the same.
    grade_limit
        Lowest grade allowed [-]; NaN without economics.
    contenders
        In the order of the results.
    """

    scenario: str
    grade_limit: float
    contenders: tuple[Contender, ...]

    def described(self) -> dict[str, object]:
        """Which scenario, and who ran; see `Described`."""
        return {"scenario": self.scenario, "contenders": "; ".join(c.label for c in self.contenders)}

    @cached_property
    def same_seeds(self) -> bool:
        """Whether all contenders ran the same seeds."""
        return len({tuple(sorted(c.seeds)) for c in self.contenders}) == 1

    def rival(self, contender: Contender, estimator: str) -> Contender | None:
        """The contender with the same controller and another estimator, of the same result if several have one."""
        same_controller = [
            c for c in self.contenders if (c.controller, c.estimator) == (contender.controller, estimator)
        ]
        same_result = [c for c in same_controller if c.result == contender.result]
        return same_result[0] if same_result else same_controller[0] if len(same_controller) == 1 else None

    def gain(self, contender: Contender, column: str) -> FloatArray:
        """What the oracle gains over fixed parameters in each seed that both ran (S,); empty if either is missing."""
        fixed, oracle = (self.rival(contender, name) for name in (FIXED, ORACLE))
        if fixed is None or oracle is None or not (fixed.has(column) and oracle.has(column)):
            return np.empty(0)
        difference = (oracle.runs[column] - fixed.runs[column]).dropna()
        return np.asarray(difference.to_numpy(dtype=float))

    def share(self, contender: Contender, column: str) -> FloatArray:
        """Share of the oracle's gain over fixed parameters that a contender reaches, paired by seed.

        Returns
        -------
        ndarray
            One value for each seed that all three ran; NaN where the oracle gains less than a thousandth of what fixed
            parameters reach. Empty where fixed or oracle did not run with this controller.
        """
        fixed, oracle = (self.rival(contender, name) for name in (FIXED, ORACLE))
        if fixed is None or oracle is None or not all(c.has(column) for c in (fixed, oracle, contender)):
            return np.empty(0)
        columns = {"own": contender, "fixed": fixed, "oracle": oracle}
        paired = pd.concat({k: c.runs[column].astype(float) for k, c in columns.items()}, axis=1, join="inner")
        gain = paired["oracle"] - paired["fixed"]
        share = (paired["own"] - paired["fixed"]) / gain
        return np.asarray(share.where(gain >= SMALLEST_GAIN * paired["fixed"].abs()).to_numpy(dtype=float))

    def summary(self) -> dict[str, Any]:
        """Content of the JSON file."""
        return {
            "scenario": self.scenario,
            "grade_limit": self.grade_limit,
            "contenders": [self._entry(c) for c in self.contenders],
        }

    def _entry(self, c: Contender) -> dict[str, Any]:
        shares = {column: self.share(c, column) for column in GAINS}
        return {
            "controller": c.controller,
            "estimator": c.estimator,
            "result": c.result,
            "seeds": c.seeds,
            "metrics": {name: vars(c.spread(name)) for name in c.metrics},
            "share_of_oracle_gain": {k: vars(SeedSpread.of(v)) for k, v in shares.items() if v.size},
            "status_counts": c.counts("status"),
            "control_status_counts": c.counts("control"),
            "decided_by": c.counts("decided"),
            "fault_counts": c.counts("fault"),
        }


def compare(table: pd.DataFrame) -> list[Comparison]:
    """Put the runs of a table side by side, scenario by scenario.

    Parameters
    ----------
    table
        Table of runs as `read_runs` returns it.

    Raises
    ------
    ResultError
        A result holds a run twice.
    """
    asked = table["scenario"]
    if "conditions" in table:
        asked = table["conditions"].fillna(table["scenario"])
    comparisons = []
    for _, rows in table.groupby(asked, sort=False):
        limit = float(rows["grade_limit"].astype(float).iloc[0]) if "grade_limit" in rows else float("nan")
        names = " / ".join(dict.fromkeys(map(str, rows["scenario"])))
        comparisons.append(Comparison(names, limit, tuple(_contenders(rows))))
    return comparisons


def compare_runs(scenario: Scenario, runs: Sequence[Run]) -> Comparison:
    """Put runs of one scenario side by side, as `compare` does with what is read from files."""
    (comparison,) = compare(pd.DataFrame(run_rows(run_summary(scenario, runs))).assign(result=""))
    return comparison


def _contenders(rows: pd.DataFrame) -> Iterator[Contender]:
    for (controller, estimator), own in rows.groupby(["controller", "estimator"], sort=False):
        parts = [("", own)] if own["seed"].is_unique else own.groupby("result", sort=False)
        for result, part in parts:
            if not part["seed"].is_unique:
                seed = part.loc[part["seed"].duplicated(), "seed"].iloc[0]
                raise ResultError(
                    f"{part['result'].iloc[0]}: holds {controller}, {estimator}, seed {seed} more than once; "
                    "remove one of them"
                )
            yield Contender(str(controller), str(estimator), str(result), part.set_index("seed").sort_index())


def seeds_of(comparisons: Sequence[Comparison]) -> list[int]:
    """All seeds of some comparisons, in order."""
    return sorted({seed for c in comparisons for contender in c.contenders for seed in contender.seeds})
