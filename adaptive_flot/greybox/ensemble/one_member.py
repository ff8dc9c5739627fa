"""A single record in one call of machine code: an ensemble of one, without vector instructions."""

from __future__ import annotations

from collections.abc import Sequence

from adaptive_flot.greybox.ensemble.ensemble import Ensemble
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.compiling.compiled import compiler_problem
from adaptive_flot.greybox.stepping.trajectory import Sensitivities, Trajectory
from adaptive_flot.greybox.stepping.whole_record.instruction_sets import SCALAR


class OneMember:
    """Simulates records as a compiled `Stepper` does, to the bit, with nothing of CasADi between the rows.

    Parameters
    ----------
    model, dt
        As of `Ensemble`.
    """

    def __init__(self, model: Model, dt: float) -> None:
        self._ensemble = Ensemble(model, dt, instructions=SCALAR)

    @classmethod
    def where_compiled(cls, model: Model, dt: float) -> OneMember | None:
        """One for a model that asks for machine code, where it can be had; else None."""
        return cls(model, dt) if model.compiled and compiler_problem() is None else None

    def simulate(self, x0: FloatArray, inputs: FloatArray, parameters: FloatArray, t0: float = 0.0) -> Trajectory:
        """Simulate N intervals with parameters (np,); see `Stepper.simulate`."""
        run = self._ensemble.simulate(x0, inputs, parameters[None], t0)
        return Trajectory(run.time, run.states[0], run.outputs[0], run.signals[0])

    def simulate_sensitivities(
        self,
        x0: FloatArray,
        inputs: FloatArray,
        parameters: FloatArray,
        wrt: Sequence[str],
        x0_gradient: FloatArray,
        t0: float = 0.0,
    ) -> Sensitivities:
        """Simulate N intervals with derivatives; see `Stepper.simulate_sensitivities`."""
        run = self._ensemble.simulate_sensitivities(x0, inputs, parameters[None], wrt, x0_gradient, t0)
        return Sensitivities(run.outputs[0], run.gradient[0], run.last_state[0], run.last_state_gradient[0])
