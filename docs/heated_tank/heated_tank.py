"""A tank with a heater in a room: the example of the documentation."""

from adaptive_flot.greybox import Model, Parameter, Quantity, Scope


def equations(m: Scope) -> None:
    """Heat balance; physics may be missing wherever a quantity passes a site."""
    temperature = m.state("temperature")
    heating = m.site("heating", m.parameter("efficiency") * m.input("power"), "actuator")
    loss = m.site("heat_loss", m.parameter("loss") * (temperature - 293.0))
    m.derivative("temperature", (heating - loss) / 4.0e5)
    m.output("temperature", m.site("thermometer", temperature, "sensor", "offset"))


def make_model() -> Model:
    """Names, units, ranges and scales; what is "estimated" is fitted to every record."""
    return Model(
        name="heated-tank",
        states=(Quantity("temperature", "K", "of the water", 273.0, 373.0, scale=10.0),),
        inputs=(
            Quantity("power", "W", "of the heater", 0.0, 1.0e4),
            Quantity("fan_speed", "1/s", "in the room", 0.0, 100.0),
        ),
        parameters=(
            Parameter("efficiency", 0.9, "-", "data sheet", lower=0.5, upper=1.0, scale=0.05, role="estimated"),
            Parameter("loss", 80.0, "W/K", "a guess", lower=1.0, upper=1.0e3, scale=10.0, role="estimated"),
        ),
        outputs=(Quantity("temperature", "K", "of the water"),),
        equations=equations,
        max_step_s=60.0,
        initial_guess={"temperature": 310.0},
    )
