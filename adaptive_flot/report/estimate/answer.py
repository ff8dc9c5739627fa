"""The answer of the estimation report: who predicts the test block best, and by how much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.units import amount, exponent, with_std
from adaptive_flot.contracts import Status
from adaptive_flot.greybox.model import Quantity
from adaptive_flot.report.estimate import series
from adaptive_flot.report.kit.parts import Fact, Table
from adaptive_flot.report.kit.wording import capital, joined, number, p_text, spaced
from adaptive_flot.runner.commands.estimate import RecordEstimate
from adaptive_flot.runner.results.replay_table import ReplayErrors

MOST_FACTS = 5
ABOUT = 0.5
"""Points of fit within which estimators are said to predict about equally well."""
WORSE = -10.0
"""Fit [%] below which an output is predicted worse than by a constant: noise alone may give a little less than 0."""
ROUNDING = 1e-7
"""Error over the scale of an output below which nothing is worse."""
NOT_WHITE = 0.05
"""p value below which innovations are called not white."""


NOTHING_FITTED = (
    "Nothing was fitted. The estimators start from the model's own values. Check the units of the columns, and the "
    "model's initial_guess and max_step_s."
)
"""What to do where the model can not simulate the record."""


def title(result: RecordEstimate) -> str:
    """What is wrong with the fit; else who predicts the test block best, or who all do so about equally well."""
    wrong = troubles(result)
    if wrong:
        return capital("; ".join(wrong))
    outputs = series.measured_outputs(result)
    fits = {
        r.estimator: [_fit(result, q, _error(result, r.estimator, q).free_run) for q in outputs] for r in result.replays
    }
    top = np.nanmax(np.array(list(fits.values())), axis=0)
    near = [who for who, own in fits.items() if np.all(np.array(own) >= top - ABOUT)]
    if len(near) > 1:
        return f"{joined(near)} predict about equally well"
    winners = [_best(result, q)[0] for q in outputs]
    best = max(dict.fromkeys(winners), key=winners.count)
    won = [spaced(q.name) for q, w in zip(outputs, winners, strict=True) if w == best]
    return f"{best} predicts {'every output' if len(won) == len(outputs) > 1 else joined(won)} best"


def troubles(result: RecordEstimate) -> list[str]:
    """Why the fit is not to be used: parameters that the record does not tell, outputs that no estimator predicts."""
    if result.batch.status is Status.NOT_FINITE:
        return [result.batch.identifiability.verdict]
    judged = result.batch.identifiability.parameters
    unknown, bound = ([label for label, _, word in judged if word == w] for w in ("not identified", "on a bound"))
    best = [(q, _best(result, q)[1].free_run) for q in series.measured_outputs(result)]
    worse = [spaced(q.name) for q, e in best if _fit(result, q, e) < WORSE and e > ROUNDING * q.scale]
    said = []
    if unknown:
        said.append(f"the record does not identify {joined(unknown)}")
    if bound:
        said.append(f"{joined(bound)} {'ends on a bound' if len(bound) == 1 else 'end on bounds'}")
    if worse:
        said.append(f"the fit of {joined(worse)} is worse than a constant: check the signs and units of the inputs")
    return said


def sentences(result: RecordEstimate) -> list[str]:
    """Who predicts best and how well, and in which outputs something is left; or what to check."""
    if result.batch.status is Status.NOT_FINITE:
        return [NOTHING_FITTED]
    outputs = series.measured_outputs(result)
    reached = [f"{spaced(q.name)} {number(_fit(result, q, _best(result, q)[1].free_run), '.1f')} %" for q in outputs]
    parameters = [f"{e.label} = {with_std(e.value, e.std, e.unit)}" for e in result.batch.estimates]
    said = [
        f"On rows that fitted nothing, simulated from the inputs alone, the best model reaches a fit of "
        f"{joined(reached)}."
    ]
    p_values = [(q, _best(result, q)[1].ljung_box_p) for q in outputs]
    left = [spaced(q.name) for q, p in p_values if p < NOT_WHITE]
    white = [spaced(q.name) for q, p in p_values if p >= NOT_WHITE]
    if left:
        said.append(
            f"Something is left that the model does not explain in {joined(left)} (Ljung–Box p < {NOT_WHITE:g})"
            + (f"; nothing that shows in {joined(white)}." if white else ".")
        )
    elif white:
        said.append("What is left passes for white noise in every output.")
    said.append(f"Batch fit: {', '.join(parameters)}; identifiability: {result.batch.identifiability.verdict}.")
    return said


def per_output(result: RecordEstimate) -> list[str]:
    """What the best one reaches for each output, and whether something is left."""
    said = []
    for q in series.measured_outputs(result):
        best, e = _best(result, q)
        text = (
            f"{capital(spaced(q.name))}: {best} has the smallest free-run error on the test block, "
            f"{amount(e.free_run, q.unit)}"
        )
        p = e.ljung_box_p
        if np.isfinite(p):
            left = "something is left that the model does not explain" if p < NOT_WHITE else "they pass for white"
            text += f"; Ljung–Box p of its innovations there {p_text(p)}: {left}"
        said.append(text + ".")
    return said


def facts(result: RecordEstimate) -> list[Fact]:
    """Fit of the best free run of each output, beside that of constant parameters; and what was fitted."""
    if result.batch.status is Status.NOT_FINITE:
        return []
    found = []
    for q in series.measured_outputs(result)[:MOST_FACTS]:
        best, e = _best(result, q)
        value = f"{number(_fit(result, q, e.free_run), '.1f')} %"
        found.append(Fact(f"Fit of {spaced(q.name)}", value, f"free run, {best}; {_beside(result, q)}"))
    for estimate in result.batch.estimates[: max(0, MOST_FACTS - len(found))]:
        note = f"± {amount(estimate.std, estimate.unit)}, batch fit"
        found.append(Fact(estimate.label, amount(estimate.value, estimate.unit), note))
    return found


def _beside(result: RecordEstimate, q: Quantity) -> str:
    others = {r.estimator: _error(result, r.estimator, q) for r in result.replays}
    name = "fixed" if "fixed" in others else next(iter(others))
    return f"{name} {number(_fit(result, q, others[name].free_run), '.1f')} %"


def fit_matrix(result: RecordEstimate) -> Table:
    """Estimator by output: fit of the free run on the test block, the best of each column marked."""
    outputs = series.measured_outputs(result)
    fits = {
        q.name: np.array([_fit(result, q, _error(result, r.estimator, q).free_run) for r in result.replays])
        for q in outputs
    }
    rows = [
        (r.estimator, *(number(values[i], ".1f") for values in fits.values())) for i, r in enumerate(result.replays)
    ]
    caption = (
        "Fit of the free run in percent on the test block, 100 (1 − RMS error / standard deviation of the measured "
        "values): 100 is perfect, 0 is as good as the mean, less is worse than that. ★: the best."
    )
    colours = tuple(colour_name(result, r.estimator) for r in result.replays)
    table = Table(caption, ("Estimator", *map(spaced, fits)), tuple(rows), colours=colours)
    for j, values in enumerate(fits.values(), 1):
        table = table.with_best(j, np.round(values, 1))
    return table


def colour_name(result: RecordEstimate, estimator: str) -> str:
    """Colour of an estimator, as `charts.palette` names it."""
    return f"slot-{series.roles(result)[estimator][1]}"


def powers(result: RecordEstimate) -> dict[str, int]:
    """Power of ten of each output's errors: one unit an output."""
    sizes: dict[str, list[float]] = {}
    for replay in result.replays:
        for e in replay.errors:
            sizes.setdefault(e.output, []).extend((e.one_step, e.free_run))
    return {output: exponent(np.array(values)) for output, values in sizes.items()}


def _error(result: RecordEstimate, estimator: str, q: Quantity) -> ReplayErrors:
    replay = next(r for r in result.replays if r.estimator == estimator)
    return next(e for e in replay.errors if e.block == "test" and e.output == q.name)


def _best(result: RecordEstimate, q: Quantity) -> tuple[str, ReplayErrors]:
    errors: Sequence[tuple[str, ReplayErrors]] = [(r.estimator, _error(result, r.estimator, q)) for r in result.replays]
    return min(errors, key=lambda pair: pair[1].free_run if np.isfinite(pair[1].free_run) else np.inf)


def _fit(result: RecordEstimate, q: Quantity, error: float) -> float:
    """Fit [%] of an error on the test block; NaN where the output does not vary there."""
    table = result.replays[0].table
    spread = float(np.nanstd(table.loc[table["block"] == "test", f"{q.column}_measured"].to_numpy(dtype=float)))
    return 100.0 * (1.0 - error / spread) if spread > 0 else float("nan")
