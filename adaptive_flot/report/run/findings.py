"""Sentences of the run report, each made from the numbers of the runs at hand: no conclusion is written here."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from adaptive_flot.charts.plotdata import Role
from adaptive_flot.contracts.batch import INSEPARABLE
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.metrics import rmse
from adaptive_flot.report.kit.wording import number
from adaptive_flot.report.run.absorbed import absorbed
from adaptive_flot.report.run.series import CaseRuns, residuals
from adaptive_flot.report.run.tables import SIGNIFICANT, coverage, median, quantities, relative_error
from adaptive_flot.runner.commands.runs.run_result import Run

TIED = 0.8
"""Correlation of the errors of two parameters from which they are said to lie along one line."""
NOTABLE = 0.01
"""Share of samples from which swings are reported."""
SAME = 0.005
"""Difference [%] that two decimals do not show."""


def findings(case: CaseRuns) -> list[str]:
    """Say where the runs stand: against the published fits, against constant parameters, and in their statistics."""
    adaptive = [who for who, (role, _) in case.roles.items() if role is Role.ESTIMATE]
    constant = [who for who, (role, _) in case.roles.items() if role is Role.CONSTANT]
    sentences = _against_published(case)
    sentences += [s for who in constant for s in _plant_differs(case, who)]
    sentences += [s for who in adaptive for other in constant[:1] for s in _against_constant(case, who, other)]
    sentences += [s for who in adaptive for s in _statistics(case, who)]
    return sentences


def below_published(case: CaseRuns) -> bool:
    """Whether any median stays below its published value."""
    return any(_gap(case, who, quantity) < -SAME for who in case.roles for quantity in quantities(case))


def _gap(case: CaseRuns, who: str, quantity: str) -> float:
    """Median minus published [%]; NaN where nothing is published."""
    published = case.published(who, quantity)
    return float("nan") if published is None else median(case.fits(who, quantity)) - published


def _against_published(case: CaseRuns) -> list[str]:
    below, reached = [], []
    for who in case.roles:
        for quantity in quantities(case):
            published, gap = case.published(who, quantity), _gap(case, who, quantity)
            if published is None or np.isnan(gap):
                continue
            fits = case.fits(who, quantity)
            name = f"{who}, {_spaced(quantity)}"
            if gap < -SAME:
                best = f"best seed {number(float(np.nanmax(fits)))}" if len(fits) > 1 else "one seed"
                below.append(f"{name}: {number(median(fits))}, {number(-gap)} below {number(published)} ({best})")
            else:
                reached.append(f"{name}: {number(median(fits))} against {number(published)}")
    sentences = []
    if below:
        sentences.append(f"Below the published fit in the median: {'; '.join(below)}.")
    if reached:
        sentences.append(f"At or above the published fit in the median: {'; '.join(reached)}.")
    return sentences


def _plant_differs(case: CaseRuns, who: str) -> list[str]:
    """What no estimator can change tells whether plant and inputs are those of the publication."""
    sentences: list[str] = []
    plugin = case.scenario.file.estimators.get(who)
    if plugin is None or plugin.start != "nominal":
        return sentences
    for quantity in (q.name for q in case.outputs):
        published, fits = case.published(who, quantity), case.fits(who, quantity)
        if published is None or not np.isfinite(fits).any() or np.nanmin(fits) <= published <= np.nanmax(fits):
            continue
        sentences.append(
            f"Constant parameters ({who}) give {number(median(fits))} for {_spaced(quantity)}, {number(published)} is "
            "published, outside the range of our seeds. No estimation enters this number: inputs, plant or start "
            "differ from the published runs, so the other fits do not compare like with like either."
        )
    return sentences


def _against_constant(case: CaseRuns, who: str, other: str) -> list[str]:
    gains = {q: median(case.fits(who, q)) - median(case.fits(other, q)) for q in quantities(case)}
    known = [f"{_spaced(q)} {number(gain, '+.2f')}" for q, gain in gains.items() if np.isfinite(gain)]
    return (
        [f"Against constant parameters ({other}), {who} changes the median fit by: {', '.join(known)}."]
        if known
        else []
    )


def _statistics(case: CaseRuns, who: str) -> list[str]:
    told = absorbed(who, case.of(who))
    return [*_whiteness(case, who), _coverage(case, who), *_swings(case, who), *_tied(case, who), *told]


def _whiteness(case: CaseRuns, who: str) -> list[str]:
    sentences = []
    for q in case.outputs:
        rows = [residuals(case, run, q) for run in case.of(who)]
        p = np.array([r.p_value for r in rows])
        rejected, tested = int(np.sum(p < SIGNIFICANT)), int(np.sum(np.isfinite(p)))
        size = median(np.array([rmse(r.values) for r in rows]))
        verdict = "are not white" if 2 * rejected > tested else "pass for white"
        sentences.append(
            f"The innovations of {who} for {_spaced(q.name)} {verdict} (Ljung–Box p < {SIGNIFICANT:g} in {rejected} of "
            f"{tested} runs); their RMS is {number(size, '.1f')} times the standard deviation the estimator expects."
        )
    return sentences


def _coverage(case: CaseRuns, who: str) -> str:
    shares = (
        f"{label} {number(100 * median(np.array([coverage(case, run, label) for run in case.of(who)])), '.0f')} %"
        for label in case.labels
    )
    return (
        f"The truth lies within ±2σ of {who} in this share of the samples (95 % if σ were right): {', '.join(shares)}."
    )


def _swings(case: CaseRuns, who: str) -> list[str]:
    """Name an estimate that swings to and fro by more than its noise explains."""
    swings = []
    for label in case.labels:
        share = median(np.array([swing_share(case, run, label) for run in case.of(who)]))
        if share > NOTABLE:
            swings.append(f"{label} {number(100 * share, '.0f')} %")
    if not swings:
        return []
    return [
        f"{who} swings from sample to sample: in this share of the samples its estimate turns back by more than half "
        f"of its σ (median over the runs): {', '.join(swings)}."
    ]


def swing_share(case: CaseRuns, run: Run, label: str) -> float:
    """Share of the rows shown at which two successive moves of an estimate, each above half its σ, are opposite."""
    table = case.shown(run)
    with np.errstate(divide="ignore", invalid="ignore"):  # σ is zero where nothing is estimated
        moves = np.diff(table[f"{label}_estimate"].to_numpy()) / table[f"{label}_std"].to_numpy()[1:]
    turns = (moves[1:] * moves[:-1] < 0) & (np.minimum(np.abs(moves[1:]), np.abs(moves[:-1])) > 0.5)
    return float(np.mean(turns)) if len(turns) else float("nan")


def _tied(case: CaseRuns, who: str) -> list[str]:
    ties = []
    for a, b in combinations(case.labels, 2):
        r = median(
            np.array([_correlation(relative_error(case, x, a), relative_error(case, x, b)) for x in case.of(who)])
        )
        if abs(r) >= TIED:
            ties.append(
                f"The errors of {a} and {b} in {who} have a correlation of {number(r, '+.2f')} (median over the runs): "
                "they lie along one line."
            )
    return ties


def _correlation(a: FloatArray, b: FloatArray) -> float:
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < 3 or np.ptp(a[known]) == 0 or np.ptp(b[known]) == 0:
        return float("nan")
    return float(np.corrcoef(a[known], b[known])[0, 1])


def candidates(cases: Sequence[CaseRuns]) -> list[str]:
    """Candidate causes of fits below the published ones, from what scenario and model say; none is proved here."""
    causes: list[str] = []
    for case in cases:
        if below_published(case):
            causes += [*_unknown_inputs(case), *_chosen_constants(case), *_estimator_causes(case), *_one_ridge(case)]
    return list(dict.fromkeys(causes))


def _unknown_inputs(case: CaseRuns) -> list[str]:
    file = case.scenario.file
    drawn = [
        q.name.replace("_", " ")
        for q in case.scenario.model.inputs
        if getattr(file.inputs[q.column], "seed", None) == "per_run"
    ]
    if not drawn:
        return []
    return [f"The published sequence of {', '.join(drawn)} is not known; each seed draws another one."]


def _chosen_constants(case: CaseRuns) -> list[str]:
    groups = dict.fromkeys(
        p.name.split(".")[0].replace("_", " ") for p in case.scenario.model.parameters if "chosen" in p.source
    )
    if not groups:
        return []
    return [f"Not all constants of the plant are published; chosen by us in whole or in part: {', '.join(groups)}."]


def _estimator_causes(case: CaseRuns) -> list[str]:
    causes = []
    for who, plugin in case.scenario.file.estimators.items():
        forgetting = plugin.options.get("forgetting")
        if who not in case.roles or plugin.use != "rpem":
            continue
        causes.append(
            f"{who} differentiates its one-step prediction with the state before it held, and does not correct that "
            "state: an effect of the parameters that builds up over many samples hardly enters the gradient, and an "
            "error in the state lasts as long as the slow states of the model."
        )
        if isinstance(forgetting, float) and forgetting < 1.0:
            memory = case.scenario.dt / (1.0 - forgetting)
            causes.append(
                f"With a forgetting factor of {forgetting:g}, {who} follows a change about {memory:.0f} s late."
            )
    return causes


def _one_ridge(case: CaseRuns) -> list[str]:
    pairs = next(iter(case.first.values())).initial.identifiability.pairs
    return [
        f"{a} and {b} act on the driving outputs in nearly the same way, so that one can stand in for the other (in "
        f"the initial estimate their correlation is beyond {number(np.sign(r) * INSEPARABLE)})."
        for a, b, r in pairs
    ]


def _spaced(name: str) -> str:
    return name.replace("_", " ")
