"""A store that the model leaves out, on a box whose wall it does not have: a process that is not flotation."""

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.joint.rows import noise_floor
from adaptive_flot.discovery.innovations.judge import judge
from adaptive_flot.discovery.innovations.search.beam import best_explanations
from adaptive_flot.discovery.innovations.search.search import Search
from adaptive_flot.greybox import Model, Parameter, Quantity, Scope
from tests.discovery.innovations.box import DT, record

WALL = 2500.0 / 3.2
"""Time constant of the wall: its capacity over its exchange with the air and the room [s]."""


def _air_alone() -> Model:
    """The box as one balance."""

    def equations(m: Scope) -> None:
        air = m.state("air")
        heater = m.site("heater", m.input("power"), "actuator", unit="W")
        loss = m.site("loss", m.parameter("conductance") * (air - 22.0), "flow", unit="W")
        other = m.site("other_heat", 0.0 * air, "process", "offset", unit="W")
        m.derivative("air", (heater + other - loss) / m.parameter("capacity"))
        m.output("thermometer", m.site("thermometer", air, "sensor", "offset", unit="K"))

    def constant(name: str, value: float, unit: str) -> Parameter:
        return Parameter(name, value, unit, "", lower=value / 30, upper=30 * value, scale=value / 3, role="estimated")

    return Model(
        name="box",
        states=(Quantity("air", "degC", "", scale=3.0),),
        inputs=(Quantity("power", "W", "", 0.0, 100.0),),
        parameters=(constant("conductance", 0.6, "W/K"), constant("capacity", 500.0, "J/K")),
        outputs=(Quantity("thermometer", "degC", "", scale=3.0),),
        equations=equations,
        max_step_s=DT,
        starts_steady=False,
        initial_guess={"air": 22.0},
    )


def test_a_store_that_the_model_leaves_out_is_found_with_its_time_constant() -> None:
    """It is refitted though many effects of one number screen better: most models leave a store out."""
    data, plain = record((), rows=400), _air_alone()
    search = Search(plain, data, (0,), noise_floor([data], (0,)), ("conductance", "capacity"))
    with np.errstate(all="ignore"):
        base = search.base(plain.parameter_values)
        found = best_explanations(search, base)
        told = judge(search, base, found)
    store = next(h for h in found[0].hypotheses if h.kind == "store")
    model = search.model_of(found[0])
    tau = model.parameters[model.index("parameters", store.effect.parameter("time_constant"))].value
    assert tau == pytest.approx(WALL, rel=0.3)
    assert ("loss", "air") in {(h.site, h.driver) for h in told.effects}
