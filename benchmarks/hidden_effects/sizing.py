"""How large an effect is: what it changes in the outputs after n and C have soaked up what they can, over the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.hidden_effects.base_fit import BURN_IN, project, sensitivity
from benchmarks.hidden_effects.experiment import Experiment, Run, Structure, nominal, run
from benchmarks.hidden_effects.simulate import Array, SimulationError
from benchmarks.hidden_effects.sites import SENSOR_SITES
from benchmarks.hidden_effects.spec import Spec

ORDINARY = (5.0, 50.0)  # noise standard deviations, root mean square
_FLOWS = {"air_flow", "feed_flow", "gas_slip", "burst_rate", "tails_valve"}
_ANY_OUTPUT = ({*SENSOR_SITES} | _FLOWS) - {"grade_sensor"}  # sites that may show elsewhere than in the grade


@dataclass(frozen=True)
class Sized:
    """A run with effects, what they change in each output [noise std, rms], the shift of n and C that hides part."""

    done: Run
    raw: dict[str, float]
    removable: dict[str, float]
    absorbed: tuple[float, float]  # relative change of n and C
    noise: dict[str, float]

    def of(self, site: str) -> float:
        """The size that counts for a site: in the grade, or in whatever output shows a sensor or valve most."""
        return max(self.removable.values()) if site in _ANY_OUTPUT else self.removable["concentrate_grade"]


def noise_std(experiment: Experiment, done: Run) -> dict[str, float]:
    """Standard deviation of the noise of each measured output."""
    return {name: float(np.std(done.noisy[name] - done.clean[name])) for name in experiment.outputs}


def measure(experiment: Experiment, specs: Sequence[Spec], structure: Structure | None = None) -> Sized:
    """Run the experiment with effects and hold it against the nominal cell under the same inputs.

    Raises
    ------
    SimulationError
        As `experiment.run`.
    """
    done = run(experiment, specs, structure)
    noise = noise_std(experiment, done)
    base = nominal(experiment, done)
    difference = {name: done.clean[name] - base[name] for name in noise}
    theta = np.log(np.array([experiment.n, experiment.C]))
    slopes = sensitivity(theta, done.inputs, done.start, base, tuple(noise))
    rows = slice(BURN_IN, None)
    shift, left = project(difference, slopes, noise, rows)
    return Sized(
        done, _rms(difference, noise, rows), _rms(left, noise, rows), (float(shift[0]), float(shift[1])), noise
    )


def _rms(columns: dict[str, Array], noise: dict[str, float], rows: slice) -> dict[str, float]:
    return {name: float(np.sqrt(np.mean(columns[name][rows] ** 2))) / noise[name] for name in noise}


def scale_to(
    experiment: Experiment, spec: Spec, target: float, limits: tuple[float, float]
) -> tuple[Spec, Sized] | None:
    """Search the amplitude that gives the target size (within 30 %); the nearest found, or None if nothing runs."""
    best: tuple[Spec, Sized] | None = None
    amplitude, roof = spec.amplitude, limits[1] if spec.amplitude > 0 else limits[0]
    for _ in range(5):
        trial = replace(spec, amplitude=amplitude)
        try:
            sized = measure(experiment, [trial])
        except SimulationError:
            roof = 0.7 * abs(amplitude)
            amplitude *= 0.5
            continue
        size = sized.of(spec.site)
        if best is None or abs(np.log(size / target)) < abs(np.log(best[1].of(spec.site) / target)):
            best = (trial, sized)
        if abs(np.log(size / target)) < 0.26:
            break
        wish = abs(amplitude) * float(np.clip(target / max(size, 1e-9), 0.1, 4.0))
        wish = min(wish, roof)
        if abs(wish - abs(amplitude)) < 1e-3 * abs(amplitude):
            break
        amplitude = float(np.copysign(wish, amplitude))
    return best
