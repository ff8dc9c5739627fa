"""Tables of the run report: fits, parameter errors, innovations, initial estimate, statuses."""

from __future__ import annotations

import numpy as np

from adaptive_flot.charts.plotdata import Role
from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.contracts import Status
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.metrics import rmse
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number, p_text, seed_list
from adaptive_flot.report.run.series import CaseRuns, residuals
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.results.whiteness import WHITENESS_LAGS

SIGNIFICANT = 0.05
"""p value below which innovations are called not white."""


def median(values: FloatArray) -> float:
    """Median of the finite values (S,); NaN if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else float("nan")


def quantities(case: CaseRuns) -> list[str]:
    """Names of the fits: adapted parameters, then driving outputs."""
    return [*case.labels, *(q.name for q in case.outputs)]


def fits_table(case: CaseRuns) -> Table:
    """Fit of each estimator and quantity over the seeds, beside the published one."""
    rows = []
    for who in case.roles:
        for quantity in quantities(case):
            fits, published = case.fits(who, quantity), case.published(who, quantity)
            beside = ("–", "–") if published is None else (number(published), number(median(fits) - published, "+.2f"))
            row = (who, _spaced(quantity), number(median(fits)), _range(fits))
            rows.append((*row, *beside) if case.scenario.file.published else row)
    after = case.scenario.fits_after
    caption = (
        f"Fit in percent, 100 (1 − ‖truth − estimate‖ / ‖truth‖) over t > {after:g} s; the estimate of an output is "
        f"its prediction before the sample is used. Over {seeds_text(case)}."
    )
    header = ("Estimator", "Quantity", "Median", "Min\u00a0–\u00a0max", "Published", "Difference")
    return Table(caption, header if case.scenario.file.published else header[:4], tuple(rows), words=2)


def parameter_table(case: CaseRuns) -> Table:
    """Error of each adapted parameter and how often the truth lies within two standard deviations."""
    rows = []
    for who, (role, _) in case.roles.items():
        for label in case.labels:
            errors = [relative_error(case, run, label) for run in case.of(who)]
            inside = np.array([coverage(case, run, label) for run in case.of(who)])
            rms = median(np.array([100 * rmse(e) for e in errors]))
            last = median(np.array([100 * e[-1] for e in errors]))
            within = number(100 * median(inside), ".0f") if role is Role.ESTIMATE else "–"
            rows.append((who, label, number(rms, ".1f"), number(last, "+.1f"), within))
    caption = f"Errors of the adapted parameters in percent of the truth, medians over {seeds_text(case)}."
    header = ("Estimator", "Parameter", "RMS error [%]", "Error at the end [%]", "Truth within ±2σ [% of samples]")
    return Table(caption, header, tuple(rows), words=2)


def innovation_table(case: CaseRuns) -> Table:
    """Size and whiteness of the innovations over all seeds."""
    rows = []
    for q in case.outputs:
        for who in case.roles:
            residual_of_run = [residuals(case, run, q) for run in case.of(who)]
            size = median(np.array([rmse(r.values) for r in residual_of_run]))
            bias = median(
                np.array([float(np.nanmean(r.values)) for r in residual_of_run if np.isfinite(r.values).any()])
            )
            p = np.array([r.p_value for r in residual_of_run])
            rejected = f"{int(np.sum(p < SIGNIFICANT))} of {int(np.sum(np.isfinite(p)))}"
            rows.append((_spaced(q.name), who, number(bias, "+.2f"), number(size), p_text(p[0]), rejected))
    caption = (
        "Innovations (measured − predicted) over the standard deviation the estimator expects: white with mean 0, "
        f"RMS 1 if all is right. Mean and RMS: medians over {seeds_text(case)}. p: Ljung–Box, {WHITENESS_LAGS} lags."
    )
    first = f"p, seed {case.seeds[0]}"
    header = ("Output", "Estimator", "Mean", "RMS", first, f"Seeds with p < {SIGNIFICANT:g}")
    return Table(caption, header, tuple(rows), words=2)


def initial_table(case: CaseRuns) -> Table:
    """Batch estimate that the recursive estimators start from."""
    fits = {run.seed: run.initial for run in case.runs}
    first = fits[case.seeds[0]]
    table = next(iter(case.first.values())).table
    model, part = case.scenario.model, case.scenario.file.initial_estimate
    started = model.with_parameters(part.guess).parameter_values
    guesses = dict(zip(case.labels, started[model.indices("parameters", case.scenario.setup.parameters)], strict=True))
    rows = []
    for estimate, (_, _, judged) in zip(first.estimates, first.identifiability.parameters, strict=True):
        every = np.array([e.value for fit in fits.values() for e in fit.estimates if e.label == estimate.label])
        label = estimate.label
        truth = table[f"{label}_true"].iloc[0] if f"{label}_true" in table else float("nan")
        guess = guesses.get(label, float("nan"))
        power = exponent(np.array([estimate.value]))
        scaled = (10.0**-power * v for v in (truth, guess, estimate.value, estimate.std, every.min(), every.max()))
        *values, low, high = (number(v, ".3f") for v in scaled)
        rows.append((label, unit_text(estimate.unit, power), judged, *values, f"{low} – {high}"))
    verdict = first.identifiability.verdict
    caption = (
        f"Initial estimate by {part.method} from the record up to {part.until_s:g} s, seed {case.seeds[0]}; last "
        f"column over {seeds_text(case)}. In words: {verdict}."
    )
    header = (
        "Parameter",
        "Unit",
        "Verdict",
        "Truth at the start",
        "First guess",
        "Estimate",
        "σ",
        "Min\u00a0–\u00a0max",
    )
    return Table(caption, header, tuple(rows), words=3)


def status_table(case: CaseRuns) -> Table:
    """How often each estimator returned which status, and how long a run took."""
    known = [s for s in Status if any(run.status_counts.get(s.name.lower()) for run in case.runs)]
    rows = []
    for who in case.roles:
        runs = case.of(who)
        counts = (sum(run.status_counts.get(s.name.lower(), 0) for run in runs) for s in known)
        took = median(np.array([r.seconds for r in runs]))
        rows.append((who, *(f"{n:,}".replace(",", " ") for n in counts), number(took)))
    caption = (
        "Samples of all runs by status, and median wall-clock time of a run (that of the first estimator holds the "
        "initial fit, which the others share)."
    )
    header = ("Estimator", *(s.value[:1].upper() + s.value[1:] for s in known), "Time of a run [s]")
    return Table(caption, header, tuple(rows))


def relative_error(case: CaseRuns, run: Run, label: str) -> FloatArray:
    """(estimate − truth) / truth of a parameter over the rows shown (N,)."""
    table = case.shown(run)
    true = table[f"{label}_true"].to_numpy()
    error: FloatArray = (table[f"{label}_estimate"].to_numpy() - true) / true
    return error


def coverage(case: CaseRuns, run: Run, label: str) -> float:
    """Share of the rows shown in which the truth lies within two standard deviations of the estimate."""
    table = case.shown(run)
    distance = np.abs(table[f"{label}_estimate"].to_numpy() - table[f"{label}_true"].to_numpy())
    known = np.isfinite(distance)
    if not known.any():
        return float("nan")
    return float(np.mean(distance[known] <= 2 * table[f"{label}_std"].to_numpy()[known]))


def seeds_text(case: CaseRuns) -> str:
    """Name the seeds of a case: "20 seeds (1–20)", "seed 1"."""
    return seed_list(case.seeds)


def _range(values: FloatArray) -> str:
    finite = values[np.isfinite(values)]
    lost = f"; {len(values) - len(finite)} not finite" if len(finite) < len(values) else ""
    if len(finite) < 2:
        return f"–{lost}"
    return f"{number(finite.min())} – {number(finite.max())}{lost}"


def _spaced(name: str) -> str:
    return name.replace("_", " ")
