"""Runs of many seeds at once: plants and estimators in lanes, where nothing that is decided depends on an estimate.

In an open loop the inputs are known beforehand. So the plants of all seeds are simulated first, and the estimator then
tracks all their records. Each run is the same, to the bit, whatever others are beside it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adaptive_flot.contracts.batch import BatchFit, fits_many
from adaptive_flot.contracts.ensemble_record import EnsembleRecord, tracks_ensembles
from adaptive_flot.contracts.track import Track
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.runner.commands.runs.run_result import Run
from adaptive_flot.runner.commands.runs.side_by_side.plants import Member, Seen, simulate_plants, starts
from adaptive_flot.runner.loop.prepared import Prepared
from adaptive_flot.runner.loop.starts import prior_of, record_of_rows
from adaptive_flot.runner.scenario.realisation import Realisation

Fits = dict[str, BatchFit]


def can_go_side_by_side(prepared: Prepared, estimator: str, controller: str, first: Realisation) -> bool:
    """Whether runs of a combination may go side by side; `first` is any realisation of the scenario.

    The scenario runs as machine code, with the fast step, without faults, dead times or a watch. The controller is an
    open loop, and the estimator tracks ensembles and is not shown the truth.
    """
    scenario = prepared.scenario
    plain = not (
        scenario.file.faults
        or scenario.dead_times
        or scenario.file.plant.integrator == "accurate"
        or any(m.frozen_after_s is not None for m in scenario.file.measurements.values())
        or (scenario.file.discovery is not None and estimator in scenario.watched)
    )
    if not (scenario.model.compiled and plain and prepared.shares_fit(estimator)):
        return False
    setup = prepared.setup(estimator, first)
    if setup.truth is not None or not tracks_ensembles(prepared.estimator(estimator, first)):
        return False
    # of the class itself: one that is derived from it may well look at the estimate
    return bool(vars(type(prepared.controller(controller, first, setup))).get("open_loop", False))


def run_side_by_side(
    prepared: Prepared,
    estimator_name: str,
    controller_name: str,
    realisations: Sequence[Realisation],
    initial: Sequence[Fits],
) -> list[Run | Exception]:
    """Runs of a combination with several seeds, or what went wrong with one.

    Parameters
    ----------
    prepared, estimator_name, controller_name
        The combination; see `can_go_side_by_side`.
    realisations
        Of each seed.
    initial
        For each seed the batch fit under "fit" where it is known; it receives it where not.
    """
    begin = time.perf_counter()
    setup = prepared.scenario.setup
    found: dict[int, Run | Exception] = {}
    members: list[Member] = []
    for i, realisation in enumerate(realisations):
        try:
            controller = prepared.controller(controller_name, realisation, setup)
            members.append(Member.of(i, realisation, controller, setup))
        except Exception as error:
            found[i] = error
    begun = list(zip(members, starts(prepared.steady_plants, members), strict=True))
    found |= {m.place: start for m, start in begun if isinstance(start, Exception)}
    able = [(m, start) for m, start in begun if not isinstance(start, Exception)]
    if able:
        seen = simulate_plants(prepared.plants, [m for m, _ in able], [start for _, start in able])
        found |= _estimated(prepared, estimator_name, controller_name, seen, initial)
    each = round((time.perf_counter() - begin) / len(realisations), 4)
    results = (found[i] for i in range(len(realisations)))
    return [replace(r, seconds=each) if isinstance(r, Run) else r for r in results]


def _estimated(
    prepared: Prepared, estimator_name: str, controller_name: str, members: Sequence[Seen], initial: Sequence[Fits]
) -> dict[int, Run | Exception]:
    """Runs by place: an initial fit each, one tracking for all."""
    scenario, rows = prepared.scenario, prepared.scenario.initial_rows
    setup, found = scenario.setup, dict[int, Run | Exception]()
    estimator = prepared.estimator(estimator_name, members[0].member.realisation)
    records = [
        record_of_rows(scenario, setup, m.time[:rows], m.member.shown[:rows], m.measured[:rows]) for m in members
    ]
    started, states = list[Seen](), []
    for one, record, fit in zip(members, records, _initial_fits(prepared, members, records, initial), strict=True):
        place = one.member.place
        try:
            if isinstance(fit, Exception):
                raise fit
            initial[place]["fit"] = fit
            states.append(estimator.init(prior_of(prepared, estimator_name, setup, record, fit)))
            started.append(one)
        except Exception as error:
            found[place] = error
    if not started or rows >= len(scenario.starts):
        tracks: list[Track | None] = [None] * len(started)
    else:
        assert tracks_ensembles(estimator)
        tracks = [track for _, track in estimator.track_ensemble(states, _record(started, rows))]
    for one, track in zip(started, tracks, strict=True):
        place, realisation = one.member.place, one.member.realisation
        try:
            arrays = one.arrays(setup, rows, track)
            found[place] = Run.of(estimator_name, controller_name, realisation, arrays, setup, initial[place]["fit"])
        except Exception as error:
            found[place] = error
    return found


def _initial_fits(
    prepared: Prepared, members: Sequence[Seen], records: Sequence[Dataset], known: Sequence[Fits]
) -> list[BatchFit | Exception]:
    """The batch fit of each member's record: the one that is known, or one that is made here."""
    wanted = [k for k, one in enumerate(members) if "fit" not in known[one.member.place]]
    batch, made = prepared.batch, list[BatchFit | Exception]()
    if fits_many(batch):
        made = batch.fit_many([records[k] for k in wanted])
    else:
        for k in wanted:
            try:
                made.append(batch.fit(records[k]))
            except Exception as error:
                made.append(error)
    new = dict(zip(wanted, made, strict=True))
    return [new[k] if k in new else known[one.member.place]["fit"] for k, one in enumerate(members)]


def _record(members: Sequence[Seen], rows: int) -> EnsembleRecord:
    """What the estimator sees of all members after the first rows."""
    known = [m.member.known[rows:] for m in members if m.member.known is not None]
    return EnsembleRecord(
        members[0].time[rows:],
        np.array([m.member.shown[rows:] for m in members]),
        np.array([m.measured[rows:] for m in members]),
        np.array(known) if known else None,
    )
