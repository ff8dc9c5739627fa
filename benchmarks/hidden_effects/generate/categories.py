"""The seven categories of records: what is drawn for each, and what the right verdict is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.cell.equations import Structure
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.effects import curves
from benchmarks.hidden_effects.effects.beyond import draw_beyond
from benchmarks.hidden_effects.effects.catalogue import CATALOGUE, Entry
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.generate import schedule
from benchmarks.hidden_effects.generate.draw import draw_effect, draw_experiment, limits_of
from benchmarks.hidden_effects.generate.ground_truth import Hidden
from benchmarks.hidden_effects.generate.sizing import ORDINARY, Sized, measure, scale_to
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, run
from benchmarks.hidden_effects.plant.sensors import OUTPUT_OF, Fault

Rng = np.random.Generator
QUIET = ("none", "insufficient", "abstain")
_TARGETS = (np.log(6.0), np.log(40.0))


class DrawError(Exception):
    """A draw that is no record of its category (effect too small); draw again."""


@dataclass(frozen=True)
class DrawnRecord:
    """A record before it is measured for the last time."""

    category: str
    experiment: Experiment
    verdict: str
    right_verdicts: tuple[str, ...] = ()
    specs: tuple[Spec, ...] = ()
    hidden: tuple[Hidden, ...] = ()
    tolerated: tuple[dict[str, str], ...] = ()
    structure: Structure | None = None
    faults: tuple[Fault, ...] = ()
    drift: tuple[dict[str, Any], ...] = ()
    ordinary: bool = False
    note: str = ""
    size: dict[str, float] = field(default_factory=dict)
    done: SimulatedRun | None = None  # where it was run already


def draw_record(seed: int, k: int, rng: Rng, *, last: bool) -> DrawnRecord:
    """Draw record k; `last` takes an effect that is too small rather than none.

    Raises
    ------
    DrawError, SimulationError
        The draw does not do; another attempt may.
    """
    return _MAKERS[schedule.category(k)](seed, k, rng, last)


def sized_effect(experiment: Experiment, entry: Entry, rng: Rng, last: bool) -> tuple[Spec, Sized]:
    """Draw an effect of a kind, and give it a size; `last` takes one that is too small rather than none.

    Raises
    ------
    DrawError, SimulationError
        It is too small, or the cell does not run.
    """
    pilot = run(experiment)
    spec = draw_effect(rng, entry, pilot)
    target = float(np.exp(rng.uniform(*_TARGETS)))
    scaled = scale_to(experiment, spec, target, limits_of(entry, spec.shape), pilot)
    if scaled is None or (scaled[1].of(entry.site) < ORDINARY[0] and not last):
        raise DrawError(f"{entry.site}/{entry.driver}: too small")
    return scaled


def _single(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    entry = schedule.single_entry(seed, k)
    experiment = draw_experiment(rng, thin_allowed=OUTPUT_OF.get(entry.site, "level_m") in OUTPUTS[:3])
    spec, sized = sized_effect(experiment, entry, rng, last)
    ordinary = ORDINARY[0] <= sized.of(spec.site) <= ORDINARY[1]
    hidden = Hidden.of(spec, sized.removable)
    return DrawnRecord("single", experiment, "named", (), (spec,), (hidden,), ordinary=ordinary, size=sized.removable,
                done=sized.done)  # fmt: skip


def _none(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    return DrawnRecord("none", draw_experiment(rng), "none", ("none",))


def _drift(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    """n, C or both drift slowly; the model with adapted parameters is right."""
    experiment = draw_experiment(rng)
    which = str(rng.choice(["C", "n", "both"]))
    specs = []
    for site, size in (("coalescence", 0.22), ("growth_exponent", 0.1)):
        if which in ("both", "C" if site == "coalescence" else "n"):
            shape = str(rng.choice(["ramp", "gompertz", "fouling", "swing", "wander"]))
            amplitude = float(rng.choice([-1, 1]) * rng.uniform(0.4, 1.0) * size)
            parameters = curves.draw_temporal(shape, float(experiment.rows), rng)
            specs.append(Spec(site, "time", shape, amplitude, parameters, story="drift of an adapted parameter"))
    sized = measure(experiment, specs)
    why = "a drift of C or n is what an effect at coalescence or growth_exponent over time is"
    names = [{"site": s, "driver": "time", "why": why} for s in ("coalescence", "growth_exponent")]
    drift = [{"site": s.site, "shape": s.shape, "amplitude": s.amplitude} for s in specs]
    return DrawnRecord("drift", experiment, "none", ("none",), tuple(specs), tolerated=tuple(names), drift=tuple(drift),
                size=sized.removable, done=sized.done)  # fmt: skip


def _pair(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    experiment = draw_experiment(rng, thin_allowed=False)
    effects = [sized_effect(experiment, entry, rng, last) for entry in schedule.pair_entries(seed, k)]
    specs = tuple(spec for spec, _ in effects)
    together = measure(experiment, specs)
    hidden = tuple(Hidden.of(spec, sized.removable) for spec, sized in effects)
    return DrawnRecord("pair", experiment, "named", (), specs, hidden, size=together.removable, done=together.done)


def _beyond(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    kind, details = schedule.beyond_kind(seed, k), int(rng.integers(2**31))
    experiment = draw_experiment(rng)
    strength = float(rng.uniform(0.35, 0.7))
    for _ in range(3):
        effect = draw_beyond(kind, strength, details, float(experiment.rows))
        sized = measure(experiment, effect.specs, effect.structure)
        if max(sized.removable.values()) >= ORDINARY[0] or strength >= 1.0:
            break
        strength = min(1.0, 1.5 * strength)
    quiet = ("none",) if max(sized.removable.values()) < 2.0 else ()
    names = tuple({"site": s, "driver": d, "why": "part of what happens"} for s, d in effect.tolerated)
    right = ("unnamed", "class", "abstain", "insufficient", *quiet)
    return DrawnRecord("beyond", experiment, "unnamed", right, effect.specs,
                tolerated=names, structure=effect.structure, note=kind, size=sized.removable)  # fmt: skip


_STILL = {"air_flow": "air", "feed_flow": "feed", "level": "level"}


def _unexcited(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    """An effect whose driver stands still, or that starts after the end."""
    kind = schedule.unexcited_kind(seed, k)
    entry = _unexcited_entry(kind, rng)
    moving = draw_experiment(rng, thin_allowed=False, loop="open")
    spec = draw_effect(rng, entry, run(moving))  # over the driver's usual range, which the record then does not cover
    note = f"{kind}: {spec.site}/{spec.driver}"
    if kind == "late":
        onset = moving.rows + float(rng.uniform(60.0, 600.0))
        spec = replace(spec, shape="smooth_step", parameters={"onset": onset, "width": 5.0}, centre=0.0)
        return DrawnRecord("unexcited", moving, "none", QUIET, (spec,), note=note)
    source = entry.site if kind == "actuator" else kind
    experiment = draw_experiment(rng, thin_allowed=False, still=frozenset({_STILL[source]}), loop="open")
    sized = measure(experiment, [spec])
    why = "its driver does not move: it is a constant here"
    names = () if kind == "actuator" else ("constant", *(("level", "froth_depth") if kind == "level" else (kind,)))
    same = tuple({"site": spec.site, "driver": driver, "why": why} for driver in names)
    return DrawnRecord("unexcited", experiment, "none", QUIET, (spec,), tolerated=same, note=note, size=sized.removable,
                done=sized.done)  # fmt: skip


def _unexcited_entry(kind: str, rng: Rng) -> Entry:
    """An effect that a record of this kind does not excite."""
    chosen = [e for e in CATALOGUE if e.driver == kind or (kind == "level" and e.driver == "froth_depth")]
    if kind == "actuator":
        chosen = [e for e in CATALOGUE if e.site in ("air_flow", "feed_flow") and e.driver in ("lag", "delay")]
    if kind == "late":
        chosen = [e for e in CATALOGUE if e.driver == "time" and "smooth_step" in e.shapes]
    return chosen[int(rng.integers(len(chosen)))]


def _fault(seed: int, k: int, rng: Rng, last: bool) -> DrawnRecord:
    """No effect, but data that can not be trusted."""
    experiment, kind = draw_experiment(rng, thin_allowed=False, loop="open"), schedule.fault_kind(seed, k)
    rows = experiment.rows
    long = float(rng.uniform(0.45, 0.75)) * rows
    start = float(rng.uniform(0.1, 0.3)) * rows
    output = {"frozen_level": "level_m", "dead_air_recovery": "air_recovery"}.get(kind, "concentrate_grade")
    limit = float(np.quantile(run(experiment).clean["concentrate_grade"], rng.uniform(0.4, 0.6)))
    match kind:
        case "gap" | "gap_all":
            short = float(rng.uniform(120.0, 500.0))
            faults = tuple(Fault("gap", o, start, short) for o in (OUTPUTS if kind == "gap_all" else (output,)))
        case "clipped_grade":
            faults = (Fault("clipped", output, 0.0, float(rows), limit),)
        case "dead_air_recovery":
            faults = (Fault("frozen", output, 0.0, float(rows)),)
        case _:
            faults = (Fault("frozen", output, start, long),)
    sensor = {o: s for s, o in OUTPUT_OF.items()}[output]
    names = () if kind.startswith("gap") else tuple(
        {"site": sensor, "driver": d, "why": "the sensor is what fails"} for d in ("constant", "time", "lag", "delay")
    )  # fmt: skip
    expected = "none" if kind.startswith("gap") else "insufficient"
    return DrawnRecord("fault", experiment, expected, QUIET, tolerated=names, faults=faults, note=kind)


_MAKERS: dict[str, Callable[[int, int, Rng, bool], DrawnRecord]] = {
    "single": _single,
    "none": _none,
    "drift": _drift,
    "pair": _pair,
    "beyond": _beyond,
    "unexcited": _unexcited,
    "fault": _fault,
}
