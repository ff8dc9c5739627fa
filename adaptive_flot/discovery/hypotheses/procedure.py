"""The stages: constants from the reference, the model as it is on the new records, hypotheses, judgement."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from adaptive_flot.discovery.hypotheses.calibration import Calibration, calibrate, excluded_by
from adaptive_flot.discovery.hypotheses.comparison import Blocks, blocks_of
from adaptive_flot.discovery.hypotheses.cross_validation import (
    REFRESH,
    Fitted,
    Tested,
    fit_all_rows,
    model_with,
    refined,
    test_on_stretches,
    worth_testing,
)
from adaptive_flot.discovery.hypotheses.families import STRUCTURE, Hypothesis, hypotheses
from adaptive_flot.discovery.hypotheses.joint.fit import JointFit, check_intervals
from adaptive_flot.discovery.hypotheses.joint.known_before import first_states, loose_constants, scattered_starts
from adaptive_flot.discovery.hypotheses.joint.rows import Rows, measured_columns, noise_floor, rows_of
from adaptive_flot.discovery.hypotheses.judgement import Judged, UsualLoss, judge
from adaptive_flot.discovery.hypotheses.plausible import moves_though_stopped
from adaptive_flot.discovery.hypotheses.seen import seen_values
from adaptive_flot.discovery.hypotheses.telling import unless_at_noise, verdict_of
from adaptive_flot.discovery.hypotheses.without_a_site import unless_without_a_site
from adaptive_flot.discovery.results import Verdict
from adaptive_flot.discovery.results.words import WITH_A_NAME
from adaptive_flot.errors import ModelError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.step_size import with_short_steps
from adaptive_flot.parallel import one_thread, parallel_map

FAR_OPEN = 1.5
"""Standard deviation of the logarithm of a constant from which a fit asks for all derivatives at each step."""
OTHER_CONSTANTS = "The model as it is fits the new records only with constants that the reference excludes."
SIZES_OPEN = (
    "The reference tells some constants only together, and with those of this fit it would err more: sizes may be "
    "far off. Hold one of these constants fixed, or give bounds."
)


@dataclass(frozen=True)
class Comparison:
    """What several records say, and everything behind it.

    Attributes
    ----------
    verdict
        What to tell.
    model
        The model with what was named added; with the constants of the reference else.
    calibration
        Constants and usual errors; from the reference, or from the new records where there is none.
    rows, blocks
        The new records, and the blocks of rows that were judged.
    null, tested
        The model as it is, and every hypothesis, best first.
    judged
        The judgement before the words.
    tried
        Number of hypotheses that were fitted.
    referred
        Whether there was a reference.
    complete
        Whether there was time to compare all hypotheses.
    """

    verdict: Verdict
    model: Model
    calibration: Calibration
    rows: Rows
    blocks: Blocks
    null: Tested
    tested: tuple[Tested, ...]
    judged: Judged
    tried: int
    referred: bool
    complete: bool = True


@one_thread()
def compare(
    model: Model,
    records: Sequence[Dataset],
    references: Sequence[Dataset] = (),
    *,
    adapted: Sequence[str] = (),
    processes: int = 1,
    progress: Callable[[str], None] = lambda stage: None,
    ends: float = float("inf"),
) -> Comparison:
    """Find what has changed since a reference, or what a model lacks in several records of one process.

    Parameters
    ----------
    model
        The model, with sites.
    records
        New records of one process, each with an initial state of its own.
    references
        Records on which the model was right. Constants and the usual size of the errors come from them, and stay.
        Without any, the constants are fitted to the new records together with each hypothesis.
    adapted
        Names of the constants that are fitted; default those of role "estimated".
    processes
        Hypotheses that are fitted at once.
    progress
        Called with a word for each stage.
    ends
        Time of `time.monotonic` after which no further hypothesis is fitted or tested; the constants are in any case.

    Raises
    ------
    ModelError
        No site, or records of different sampling intervals.
    DataError
        No common output, or a record that the model can not simulate.
    """
    began = time.perf_counter()
    if not model.sites:
        raise ModelError(f"model '{model.name}' has no sites; pass its physical quantities through Scope.site")
    free = model.expand_parameters(adapted or [p.name for p in model.parameters if p.role == "estimated"])
    check_intervals((*records, *references))
    columns = measured_columns(model, (*records, *references))
    model = _with_steps_for(model, (*references, *records), columns)
    progress("fit the constants")
    calibration = calibrate(model, references or records, free, columns, records, local=bool(references))
    sizes = [calibration.usual.sizes(r) for r in records] if references else calibration.rows.sizes
    rows = rows_of(records, columns, sizes, calibration.rows.memory)
    constants = calibration.constants if references else loose_constants(calibration.model, free)
    # where constants may move by large factors, derivatives from before lead astray
    refresh = REFRESH if references and not constants.up_to_a_factor(FAR_OPEN) else 1
    elsewhere = () if references else scattered_starts(model, constants)
    progress("run the new records")
    base = fit_all_rows(calibration.model, rows, None, constants, None, refresh=1)
    assert base is not None  # the model as it is can be simulated: its constants were fitted
    candidates = _candidates(calibration, base.fit, rows, bool(references))
    progress(f"fit {len(candidates)} hypotheses")

    def fit_one(h: Hypothesis) -> Fitted | None:
        if time.monotonic() > ends:
            return None
        with np.errstate(all="ignore"):
            return fit_all_rows(calibration.model, rows, h, constants, base.fit, refresh=refresh, elsewhere=elsewhere)

    fitted = [f for f in parallel_map(fit_one, candidates, processes, lambda: progress("fit")) if f is not None]
    near = worth_testing(base, fitted)
    progress(f"test {len(near)} of them on fresh stretches")

    def test_one(f: Fitted) -> Tested | None:
        if f.hypothesis is not None and time.monotonic() > ends:
            return None
        with np.errstate(all="ignore"):
            near = refined(calibration.model, rows, f, refresh) if references and f.hypothesis else f
            return test_on_stretches(calibration.model, rows, near, hold_constants=bool(references))

    null, *results = parallel_map(test_one, [base, *near], processes, lambda: progress("test"))
    assert null is not None  # the model as it is is always tested
    complete = time.monotonic() <= ends
    possible = (t for t in results if t is not None and not moves_though_stopped(calibration.model, rows, t))
    tested = tuple(sorted(possible, key=lambda t: t.total))
    usual = _usual_losses(calibration) if references else None
    excluded = bool(references) and excluded_by(calibration, null.fit)
    judged, blocks = judge(rows, null, tested, usual, excluded)
    judged = judged if excluded else unless_at_noise(judged, rows, null, calibration if references else None)
    if usual is not None and complete:
        progress("compare with what has no site")
        judged = unless_without_a_site(calibration, rows, blocks, null, judged, usual, base.fit, processes, ends)
        complete = time.monotonic() <= ends
    verdict = verdict_of(calibration, rows, blocks, null, judged, bool(references), time.perf_counter() - began)
    told = judged.word in WITH_A_NAME and judged.best is not None
    if excluded and not told:
        verdict = replace(verdict, notes=(*verdict.notes, OTHER_CONSTANTS))
    if references and told and judged.best is not None and excluded_by(calibration, judged.best.fit):
        verdict = replace(verdict, notes=(*verdict.notes, SIZES_OPEN))
    best = judged.best if told and judged.best is not None else null
    extended = model_with(calibration.model, best.hypothesis).with_parameters(best.fit.values)
    return Comparison(
        verdict, extended, calibration, rows, blocks, null, tested, judged, len(candidates), bool(references), complete
    )


def _with_steps_for(model: Model, records: Sequence[Dataset], columns: Sequence[int]) -> Model:
    """The model in the steps that the record asks for which needs the shortest."""

    def asked(record: Dataset) -> Model:
        start, noise = first_states(model, [record])[0], noise_floor([record], columns)
        return with_short_steps(model, record, start, model.parameter_values, columns, noise, longer=True)

    return min(map(asked, records), key=lambda m: m.max_step_s)


def _candidates(calibration: Calibration, base: JointFit, rows: Rows, reference: bool) -> tuple[Hypothesis, ...]:
    seen, drivers = dict(calibration.seen), dict(calibration.drivers)
    if reference:
        new, moved = seen_values(calibration.model, base, rows.records)
        seen = {k: np.concatenate([v, new[k]]) for k, v in seen.items()}
        drivers = {k: np.concatenate([v, moved[k]]) for k, v in drivers.items()}
    dt = rows.records[0].dt
    found = hypotheses(calibration.model, seen, drivers, dt, dt * max(map(len, rows.records)))
    return tuple(h for h in found if not (reference and h.kind in STRUCTURE))


def _usual_losses(calibration: Calibration) -> UsualLoss:
    rows, errors = calibration.rows, calibration.fit.errors
    blocks = blocks_of(rows, errors)
    sums = blocks.sums([loss.sum(axis=1) for loss in rows.losses(errors)])
    lengths = np.array([b - a for _, a, b in blocks.edges])
    return UsualLoss(sums / lengths, len(calibration.constants.names), rows.count, calibration.usual.rms)
