"""Tables and sentences of the discovery report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adaptive_flot.charts.units import exponent, unit_text
from adaptive_flot.discovery.results import SURE, Alternative, Discovery
from adaptive_flot.discovery.verdict.judge import LEAST_MARGIN
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.report.kit.parts import Table
from adaptive_flot.report.kit.wording import number, p_text, spaced

MOST_COEFFICIENTS = 30
"""Coefficients of an effect that are listed: more are the values of a curve, which the figure shows."""
MOST_ROWS = 10


def effect_text(names: Sequence[tuple[str, str]]) -> str:
    """Sites and drivers in words.

    >>> effect_text([("bubble_size", "air_flow"), ("feed_grade", "time")])
    'bubble size by air flow, and feed grade by time'
    """
    return ", and ".join(f"{spaced(site)} by {spaced(driver)}" for site, driver in names)


def error_table(discovery: Discovery) -> Table:
    """Free-run error of each output before and after."""
    rows = []
    for c in discovery.verdict.error:
        power = exponent(np.array([c.before, c.after]))
        values = (c.size(v, number(v * 10.0**-power, ".4g")) for v in (c.before, c.after, c.noise))
        low, high = (number(100 * r, ".0f") for r in c.reduction95)
        rows.append((spaced(c.output), unit_text(c.unit, power), *values, f"{low} to {high}"))
    caption = (
        f"Root mean square error of the free run on the {discovery.verdict.split} split, which neither chose "
        "nor fitted anything. Noise: what no model can remove, as fitted. Reduction: 95 % interval of a paired block "
        "bootstrap."
    )
    caption = " ".join(filter(None, (caption, discovery.verdict.about_errors)))
    return Table(caption, ("Output", "Unit", "Before", "After", "Noise", "Reduction [%]"), tuple(rows), words=2)


def least_shown_table(discovery: Discovery) -> Table | None:
    """How large a lasting change would have to be to show, site by site; None where nothing is said of it."""
    found = discovery.verdict.least_shown
    if not found:
        return None
    rows = [(spaced(s.site), "falls by" if s.by_factor else "moves by", s.size_text) for s in found]
    caption = (
        "A change that lasts from halfway on, and the size from about which this record would have shown it in four of "
        "five cases. What is smaller may be there."
    )
    return Table(caption, ("Site", "Change", "Shows from"), tuple(rows), words=2)


def coefficient_table(discovery: Discovery) -> Table:
    """Coefficients of the effects that the verdict tells, with their intervals.

    A single effect and its form stand in the caption, so that the rest fits on a phone.
    """
    rows, effects = [], [named.effect for named in discovery.verdict.effects]
    texts = [effect_text([(e.site, e.driver)]) for e in effects]
    for named, text in zip(discovery.verdict.effects, texts, strict=True):
        units, first = discovery.model.effect_units(named.effect), (text,) if len(texts) > 1 else ()
        if len(named.effect.coefficients) > MOST_COEFFICIENTS:
            count = len(named.effect.coefficients)
            rows.append((*first, f"{count} values at knots", "–", "see figure", "see figure"))
            continue
        for name, value in named.effect.coefficients.items():
            low, high = named.interval95.get(name, (np.nan, np.nan))
            interval = "held" if np.isnan(low) else f"{number(low, '.4g')} to {number(high, '.4g')}"
            rows.append((*first, spaced(name), unit_text(units.get(name) or "-"), number(value, ".4g"), interval))
    by = "with process noise, on all rows" if discovery.by_process_noise else "on the estimation and confirm splits"
    forms = ", ".join(f"{text} (form {e.form})" for text, e in zip(texts, effects, strict=True))
    caption = (
        f"Coefficients of {forms}, fitted {by}. A factor form multiplies its site by "
        "exp(g); coefficients of g are logarithms of that factor."
    )
    header = (*(("Effect",) if len(texts) > 1 else ()), "Coefficient", "Unit", "Value", "95 % interval")
    return Table(caption, header, tuple(rows), words=len(header) - 2)


def alternative_table(discovery: Discovery) -> Table:
    """Ranked alternatives with their evidence, each refitted in full."""
    ranked = ranked_alternatives(discovery)[:MOST_ROWS]
    rows = []
    for k, a in enumerate(ranked):
        forms = ", and ".join(_form(e) for e in a.effects)
        worse = number(a.worse_than(ranked[0]), ".1f") + (
            f" ± {number(a.loglik_difference_sd, '.0f')}" if a.loglik_difference_sd else ""
        )
        values = (worse, number(a.delta_bic, ".1f"))
        rows.append((str(k + 1), effect_text(a.names), forms, "yes" if all(a.known) else "no", *values))
    caption = (
        "Alternatives, each refitted with the adapted parameters, the initial state and a noise model of its own. "
        "Δ BIC: how much worse its information criterion is than that of the best one (± its standard deviation, from "
        "resampled blocks of rows), and its difference to the model without an effect (negative is better). Known: "
        "whether the model's catalogue has a name for it."
    )
    if discovery.by_process_noise:
        caption += " To the best one it is that of fits with process noise, which have decided; else of free runs."
    header = ("Rank", "Effect", "Form", "Known", "Δ BIC to best", "Δ BIC to no effect")
    return Table(caption, header, tuple(rows), words=4)


def ranked_alternatives(discovery: Discovery) -> tuple[Alternative, ...]:
    """Alternatives of the accepted number of effects; where none was accepted, those of the first round."""
    if discovery.search is None:
        return ()
    return discovery.search.alternatives or discovery.search.rounds[0].alternatives


def _form(effect: Effect) -> str:
    return f"{effect.form} ({effect.mode})" if effect.mode else effect.form


def test_table(discovery: Discovery) -> Table:
    """Ljung-Box p value of each output, before and after."""
    tests = discovery.verdict.tests
    names = [q.name for q in discovery.model.outputs if f"ljung_box_before_{q.name}" in tests]
    shown = [[p_text(tests.get(f"ljung_box_{when}_{n}", np.nan)) for when in ("before", "after")] for n in names]
    rows = [(spaced(n), *(p.removeprefix("= ") for p in pair)) for n, pair in zip(names, shown, strict=True)]
    caption = "p value of the Ljung–Box test (20 lags) of the free-run residual; small: something is left."
    return Table(caption, ("Output", "p before", "p after"), tuple(rows))


def symptom_table(discovery: Discovery) -> Table | None:
    """What the residual of the model as it is shows, output by output."""
    if discovery.verdict.detection is None:
        return None
    rows = []
    for s in discovery.verdict.detection.symptoms:
        follows = ", ".join(map(spaced, s.follows)) or "none"
        onset = "-" if s.onset_s is None else number(s.onset_s, ".0f")
        rows.append((spaced(s.output), number(s.size, ".2f"), follows, onset, "yes" if s.shows else "no"))
    caption = (
        "Residual of the model as it is. Size: root mean square over the noise seen from row to row. Follows: inputs "
        "whose past the whitened residual depends on. Change: when its mean changes most (moving sums). Missing: "
        "whether any test rejects. All by Holm's procedure at 5 % over the tests of all outputs. These tests say that "
        "something is missing; they choose nothing."
    )
    header = ("Output", "Size", "Follows", "Change [s]", "Missing")
    return Table(caption, header, tuple(rows), words=3)


def place_table(discovery: Discovery) -> Table | None:
    """Kinds of places and causes by what the best candidate of each would explain."""
    if discovery.verdict.location is None:
        return None
    rows = [
        (group, p.kind, effect_text([(p.site, p.driver)]), number(100 * p.share, ".0f"))
        for group, places in (("where", discovery.verdict.location.places), ("when", discovery.verdict.location.causes))
        for p in places
    ]
    caption = (
        "Where and when the missing effect acts: the best candidate of each kind, and what it would explain to first "
        "order as a share of the best of all."
    )
    return Table(caption, ("Question", "Kind", "Best candidate", "Share [%]"), tuple(rows), words=3)


def absorbed_table(discovery: Discovery) -> Table:
    """Adapted parameters with and without the effect: what they had absorbed."""
    rows = []
    for label, share in discovery.verdict.absorbed.items():
        after = discovery.verdict.parameters[label]
        unit = next((p.unit for p in discovery.model.parameters if label in (p.symbol, p.name)), "-")
        power = exponent(np.array([after]))
        values = (number(v * 10.0**-power, ".4g") for v in (after * (1 + share), after))
        rows.append((label, unit_text(unit, power), *values, number(100 * share, "+.2f")))
    caption = (
        "Adapted parameters fitted without and with the effect. The difference is what they had absorbed: the plain "
        "fit bends them to mimic the effect."
    )
    return Table(caption, ("Parameter", "Unit", "Without", "With", "Absorbed [%]"), tuple(rows), words=2)


def least_difference(discovery: Discovery, a: Alternative) -> tuple[float, str]:
    """Difference in the criterion that tells an alternative from the best one, and why it is as large as that."""
    judged, search = discovery.judgement, discovery.search
    assert judged is not None and search is not None  # an alternative was judged
    chance = SURE * a.loglik_difference_sd
    if chance >= judged.margin:
        return chance, "twice the standard deviation of that difference"
    if search.left - search.left_threshold >= judged.margin:
        return judged.margin, "since the best one itself leaves so much unexplained"
    return judged.margin, f"{LEAST_MARGIN:.0f} for each effective sample of {search.rows_per_effective_sample:.1f} rows"


def not_told_apart(discovery: Discovery) -> list[str]:
    """Sentences on what this record leaves open."""
    judged = discovery.judgement
    if judged is None or judged.best is None:
        return ["There is no alternative to tell apart."]
    best = judged.best
    if discovery.by_process_noise:
        said = [
            f"{effect_text(a.names)} explains the record about as well as {effect_text(best.names)}, both with process "
            f"noise: its criterion is worse by {number(a.worse_than(best), '.1f')} ± "
            f"{number(a.loglik_difference_sd, '.1f')}, or what it is worse by comes from a few rows."
            for a in judged.rivals
        ]
        return said or ["With process noise, nothing comes near the best alternative."]
    said = []
    for a in judged.rivals:
        if judged.near(a):
            least, why = least_difference(discovery, a)
            said.append(
                f"{effect_text(a.names)} explains the record about as well as {effect_text(best.names)}: its criterion "
                f"is worse by {number(a.worse_than(best), '.1f')}, and less than {least:.0f} tells nothing here, {why}."
            )
    if not said and discovery.verdict.experiment is not None:
        said = ["Nothing comes as near as that to the best alternative; the test below is for those next to it."]
    return said or ["Nothing comes near the best alternative."]
