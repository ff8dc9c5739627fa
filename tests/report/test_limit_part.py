"""The report's part on the limit: its numbers are those of the bound and of the errors, run by run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.metrics import rmse
from adaptive_flot.report.kit.album import Album
from adaptive_flot.report.run.cramer_rao_limit import limit_part
from adaptive_flot.report.run.series import CaseRuns, cases
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.results.cramer_rao_limit import TrueRun
from adaptive_flot.runner.scenario.loading import load_scenario
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario


def short(scenario: Scenario, **changes: object) -> Scenario:
    initial = scenario.file.initial_estimate.model_copy(update={"until_s": 100.0})
    update = {"duration_s": 240.0, "fits_after_s": 100.0, "initial_estimate": initial, **changes}
    return replace(scenario, file=scenario.file.model_copy(update=update))


@pytest.fixture(scope="module")
def case() -> CaseRuns:
    scenario = load_scenario("random_walk")
    walks = {k: v.model_copy(update={"from_s": 100.0}) for k, v in scenario.file.parameters.items()}
    scenario = short(scenario, parameters=walks)
    return cases([(scenario, run_scenario(scenario, ["ekf", "fixed"], seeds=[1, 2]))])[0]


def test_ratios_are_errors_over_bounds_pooled_over_the_seeds(case: CaseRuns) -> None:
    part = limit_part(case, Album())
    assert part is not None
    assert [row[0] for row in part.table.rows] == ["n", "C"] and part.table.header[3:] == ("ekf: error / bound",)
    for i, (label, row) in enumerate(zip("nC", part.table.rows, strict=True)):
        tables = [case.shown(run) for run in case.of("ekf")]
        error = rmse(np.concatenate([t[f"{label}_estimate"] - t[f"{label}_true"] for t in tables]))
        schedule = [(seed, Realisation(case.scenario, seed).schedule) for seed in (1, 2)]
        limits = [TrueRun(Realisation(case.scenario, seed), inputs).limit()[100:, i, i] for seed, inputs in schedule]
        assert float(row[3]) == pytest.approx(error / np.sqrt(np.mean(limits)), abs=0.006)
        assert float(row[2]) < float(row[1]), "more sensors do not lower the bound"


def test_it_says_how_far_the_parameters_can_be_told_apart(case: CaseRuns) -> None:
    part = limit_part(case, Album())
    assert part is not None and len(part.sentences) == 2
    assert "correlation of n and C" in part.sentences[0] and "air recovery" in part.sentences[1]


def test_there_is_none_where_the_plant_lacks_what_is_estimated(case: CaseRuns) -> None:
    setup = replace(case.scenario.setup, parameters=("growth_exponent", "of_an_effect"))
    assert limit_part(replace(case, scenario=replace(case.scenario, setup=setup)), Album()) is None
