"""How large an effect is: what it changes in the outputs after n and C have soaked up what they can, over the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden_effects.cell.equations import Structure
from benchmarks.hidden_effects.cell.simulate import Array, SimulationError
from benchmarks.hidden_effects.cell.sites import SENSOR_SITES
from benchmarks.hidden_effects.effects.spec import Spec
from benchmarks.hidden_effects.generate.nominal_fit import BURN_IN, project, sensitivity
from benchmarks.hidden_effects.plant.experiment import Experiment, SimulatedRun, nominal, run

ORDINARY = (5.0, 50.0)  # noise standard deviations, root mean square
_FLOWS = {"air_flow", "feed_flow", "gas_slip", "burst_rate", "tails_valve"}
ANY_OUTPUT = ({*SENSOR_SITES} | _FLOWS) - {"grade_sensor"}  # sites that may show elsewhere than in the grade
_SEARCH = 5  # trials of an amplitude
Columns = dict[str, Array]


@dataclass(frozen=True)
class Sized:
    """A run with effects, and what they change in each output [noise std, rms]: all, and what n and C can not hide."""

    done: SimulatedRun
    raw: dict[str, float]
    removable: dict[str, float]

    def of(self, site: str) -> float:
        """The size that counts for a site: in the grade, or in the output that shows most."""
        return max(self.removable.values()) if site in ANY_OUTPUT else self.removable["concentrate_grade"]


def measure(experiment: Experiment, specs: Sequence[Spec], structure: Structure | None = None) -> Sized:
    """Run the experiment with effects and hold it against the nominal cell under the same inputs.

    Raises
    ------
    SimulationError
        As `experiment.run`.
    """
    done = run(experiment, specs, structure)
    base = nominal(experiment, done)
    return _sized(experiment, done, base, _slopes(experiment, done, base))


def _slopes(experiment: Experiment, done: SimulatedRun, base: Columns) -> list[Columns]:
    """Derivatives of the outputs to ln n and ln C along a run."""
    theta = np.log(np.array([experiment.n, experiment.C]))
    return sensitivity(theta, done.inputs, done.start, base, experiment.outputs)


def _sized(experiment: Experiment, done: SimulatedRun, base: Columns, slopes: list[Columns]) -> Sized:
    noise = {name: float(np.std(done.noisy[name] - done.clean[name])) for name in experiment.outputs}
    difference = {name: done.clean[name] - base[name] for name in noise}
    rows = slice(BURN_IN, None)
    left = project(difference, slopes, noise, rows)
    return Sized(done, _rms(difference, noise, rows), _rms(left, noise, rows))


def _rms(columns: Columns, noise: dict[str, float], rows: slice) -> dict[str, float]:
    return {name: float(np.sqrt(np.mean(columns[name][rows] ** 2))) / noise[name] for name in noise}


def scale_to(
    experiment: Experiment, spec: Spec, target: float, limits: tuple[float, float], pilot: SimulatedRun
) -> tuple[Spec, Sized] | None:
    """Search the amplitude that gives the target size (within 30 %); the nearest found, or None if nothing runs.

    In open loop the search holds each trial against the pilot, the run without effects; the size handed back is exact.
    """
    slopes = _slopes(experiment, pilot, pilot.clean) if experiment.loop == "open" else None
    best: tuple[Spec, Sized] | None = None
    amplitude, roof = spec.amplitude, limits[1] if spec.amplitude > 0 else limits[0]
    for _ in range(_SEARCH):
        trial = replace(spec, amplitude=amplitude)
        try:
            if slopes is None:
                sized = measure(experiment, [trial])
            else:
                sized = _sized(experiment, run(experiment, [trial]), pilot.clean, slopes)
        except SimulationError:
            roof = 0.7 * abs(amplitude)
            amplitude *= 0.5
            continue
        size = sized.of(spec.site)
        if best is None or abs(np.log(size / target)) < abs(np.log(best[1].of(spec.site) / target)):
            best = (trial, sized)
        wish = min(abs(amplitude) * float(np.clip(target / max(size, 1e-9), 0.1, 4.0)), roof)
        if abs(np.log(size / target)) < 0.26 or abs(wish - abs(amplitude)) < 0.05 * abs(amplitude):
            break
        amplitude = float(np.copysign(wish, amplitude))
    if best is None or slopes is None:
        return best
    done = best[1].done
    return best[0], _sized(experiment, done, nominal(experiment, done), slopes)
