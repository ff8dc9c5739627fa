"""The realisation of a scenario for one seed: inputs, true parameters, noise, disturbances, chance in faults."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adaptive_flot.described import Described
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.runner.scenario.disturbances import Disturbances, draw_disturbances
from adaptive_flot.runner.scenario.inputs.random_streams import Stream, generator
from adaptive_flot.runner.scenario.measurement_noise import draw_measurement_noise
from adaptive_flot.runner.scenario.scenario import Scenario


@dataclass(frozen=True, repr=False)
class Realisation(Described):
    """A scenario with one seed. Each array is worked out once and can not be written to.

    All runs with this scenario and seed see the same realisation, whatever estimates and controls.

    Attributes
    ----------
    scenario
        The scenario.
    seed
        The seed of the run.
    """

    scenario: Scenario
    seed: int

    def described(self) -> dict[str, object]:
        """Of what; see `Described`."""
        return {"scenario": self.scenario.name, "seed": self.seed}

    @cached_property
    def schedule(self) -> FloatArray:
        """Planned inputs (N, nu), those that wander as they do; each in its unit, row k from k dt on."""
        s = self.scenario
        values = [s.file.inputs[q.column].values(s.starts, self.seed) for q in s.model.inputs]
        for j, q in enumerate(s.model.inputs):
            walk = s.file.plant.feed_walk.get(q.column)
            if walk is not None:
                values[j] = values[j] * walk.factor(s.starts, self.seed, q.name)
        return _fixed(np.column_stack(values))

    @cached_property
    def plan(self) -> FloatArray:
        """Planned inputs (N, nu) as a controller may know them: disturbances keep their first value."""
        plan = self.schedule.copy()
        plan[:, self.scenario.imposed] = plan[0, self.scenario.imposed]
        return _fixed(plan)

    @cached_property
    def parameters(self) -> FloatArray:
        """True parameters of the plant's model (N, np), each in its unit, row k for the interval from k dt on."""
        s, plant = self.scenario, self.scenario.plant_model
        p = np.tile(plant.parameter_values, (len(s.starts), 1))
        for name, profile in s.moving_parameters:
            j = plant.index("parameters", name)
            p[:, j] *= profile.factor(s.starts, self.seed, plant.parameters[j].name)
        return _fixed(p)

    @cached_property
    def measurement_noise(self) -> FloatArray:
        """Noise of each output at the end of each interval (N, ny); NaN where the output is not measured then."""
        return _fixed(draw_measurement_noise(self.scenario, generator(self.seed, Stream.MEASUREMENT_NOISE)))

    def disturbances(self, model: Model | None = None) -> Disturbances:
        """What the plant imposes beside the controller, and what its instruments show of it.

        What is known of parameters comes as the parameter vector of `model`, that of estimator and controller; default
        the scenario's model.
        """
        noise = generator(self.seed, Stream.DISTURBANCE_NOISE)
        return draw_disturbances(self.scenario, self.schedule, self.parameters, model or self.scenario.model, noise)

    @cached_property
    def fault_draws(self) -> FloatArray:
        """Numbers uniform in [0, 1) for each interval and fault of the plant (N, number of faults, 2)."""
        rows = len(self.scenario.starts)
        draws = [
            generator(self.seed, Stream.FAULT, i).random((rows, 2)) for i in range(len(self.scenario.plant_faults))
        ]
        return _fixed(np.stack(draws, axis=1) if draws else np.empty((rows, 0, 2)))


def _fixed(values: FloatArray) -> FloatArray:
    values.flags.writeable = False
    return values
