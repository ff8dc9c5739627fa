"""What one run leaves behind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any

import pandas as pd

from adaptive_flot.contracts import Setup
from adaptive_flot.contracts.batch import BatchFit
from adaptive_flot.described import Described
from adaptive_flot.processes.flotation.account import account
from adaptive_flot.runner.results.accounts import control_account
from adaptive_flot.runner.results.plans import plan_table
from adaptive_flot.runner.results.run_arrays import RunArrays
from adaptive_flot.runner.results.timeseries import TimeSeries
from adaptive_flot.runner.scenario.realisation import Realisation

if TYPE_CHECKING:
    from adaptive_flot.runner.adaptation.inquiry import Inquiry  # discovery and its libraries take a second


@dataclass(frozen=True, repr=False)
class Run(Described):
    """One run.

    Attributes
    ----------
    estimator, controller, seed
        What ran.
    series
        Time series.
    fit
        Fit in percent of each adapted parameter (by label) and driving output, over t > `fits_after_s`.
    status_counts
        How often the estimator returned which status.
    initial
        The batch fit that gave the initial estimate.
    seconds
        Wall-clock time of the run.
    account
        Recovery, grade and economic value over the same times (see `account`); empty without economics.
    control
        Solve times, statuses and who decided over the same times (see `control_account`); empty without economics.
    fault_counts
        Intervals in which each injected fault changed something; empty without faults.
    plans
        What the controller expected, one row a planned move (see `plan_table`); empty where it makes no plans.
    inquiries
        What came of each alarm of a watched estimator; None where the estimator was not watched.
    """

    estimator: str
    controller: str
    seed: int
    series: TimeSeries
    fit: dict[str, float]
    status_counts: dict[str, int]
    initial: BatchFit
    seconds: float = float("nan")
    account: dict[str, float] = field(default_factory=dict)
    control: dict[str, Any] = field(default_factory=dict)
    fault_counts: dict[str, int] = field(default_factory=dict)
    plans: pd.DataFrame = field(default_factory=pd.DataFrame)
    inquiries: Sequence[Inquiry] | None = None

    @cached_property
    def table(self) -> pd.DataFrame:
        """Time series as a table; made when first asked for, since a study of many runs needs none."""
        return self.series.table()

    def described(self) -> dict[str, object]:
        """What ran and how well it fits; see `Described`."""
        quality = {f"fit of {name}": f"{value:.2f} %" for name, value in self.fit.items()}
        who = {"estimator": self.estimator, "controller": self.controller, "seed": self.seed}
        return {**who, "intervals": len(self.series.run.time), **quality}

    @classmethod
    def of(
        cls,
        estimator: str,
        controller: str,
        realisation: Realisation,
        arrays: RunArrays,
        setup: Setup,
        initial: BatchFit,
        inquiries: Sequence[Inquiry] | None = None,
    ) -> Run:
        """The run that left these arrays, of an estimator that was built for `setup`; its time is yet to be told."""
        scenario = realisation.scenario
        series = TimeSeries(scenario, arrays, setup)
        earned: dict[str, float] = {}
        control: dict[str, Any] = {}
        if scenario.prices is not None and scenario.limits is not None:
            table = series.table()
            accounted = table[table["time_s"] > scenario.fits_after + 1e-9]
            least = scenario.limits.outputs["concentrate_grade"][0]
            earned = account(accounted, scenario.plant_model, scenario.dt, scenario.prices, least)
            control = control_account(accounted)
        return cls(
            estimator,
            controller,
            realisation.seed,
            series,
            series.fits(),
            series.status_counts(),
            initial,
            account=earned,
            control=control,
            fault_counts=dict(Counter(chain.from_iterable(arrays.faults))),
            plans=plan_table(scenario.model, arrays.time, arrays.plans),
            inquiries=inquiries,
        )

    def summary(self) -> dict[str, object]:
        """Entry of the JSON summary; some of its keys only where they apply."""
        extra: dict[str, object] = {"account": self.account, "control": self.control} if self.account else {}
        if self.fault_counts:
            extra["fault_counts"] = self.fault_counts
        if self.inquiries is not None:
            extra["discovery"] = [inquiry.as_dict() for inquiry in self.inquiries]
        return {
            "estimator": self.estimator,
            "controller": self.controller,
            "seed": self.seed,
            "fit": self.fit,
            "status_counts": self.status_counts,
            "seconds": self.seconds,
            **extra,
        }
