"""Two cascaded water tanks with square-root outflow: the base model of a public identification benchmark.

M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel, *Cascaded tanks benchmark combining soft and hard nonlinearities*,
4TU.ResearchData, DOI 10.4121/12960104. Water is pumped into the upper tank, runs through a hole into the lower one
and back to the reservoir. Levels are in volts of an uncalibrated sensor; only the lower one is measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from adaptive_flot.contracts.economics import OperatingPoint
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import numeric_column
from adaptive_flot.greybox.data.dataset import Dataset, check_record
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.quantities import KnownEffect
from adaptive_flot.processes.process import Measurements, Process

BENCHMARK_COLUMNS = ("uEst", "uVal", "yEst", "yVal", "Ts")
_DRY = 1e-6
"""Level [V] below which the outflow is that of this level: keeps the square root and its slope finite."""


KNOWN_EFFECTS = (
    KnownEffect("upper_outflow", "upper_level", "outflow law of the upper tank, and what spills over its edge"),
    KnownEffect("lower_inflow", "upper_level", "what of the upper tank's outflow and spill reaches the lower tank"),
    KnownEffect("lower_outflow", "lower_level", "outflow law of the lower tank, and what spills over its edge"),
    KnownEffect("pump_flow", "pump_voltage", "pump characteristic"),
    KnownEffect("pump_flow", "time", "pump that wears or clogs"),
    KnownEffect("pump_flow", "lag", "slow pump"),
    KnownEffect("pump_flow", "delay", "dead time of the pump line"),
    *(KnownEffect(f"{name}_outflow", "time", f"hole of the {name} tank that clogs") for name in ("upper", "lower")),
    KnownEffect("level_sensor", "constant", "level sensor with an offset or gain error"),
    KnownEffect("level_sensor", "lower_level", "level sensor that is not linear"),
    KnownEffect("level_sensor", "time", "level sensor that drifts"),
    KnownEffect("level_sensor", "lag", "slow level sensor"),
)
"""What may be missing in such a plant: any textbook's list, with no number in it."""


def make_model() -> Model:
    """Cascaded tanks without overflow (benchmark paper)::

        dx1/dt = -k1 sqrt(x1) + k4 u        upper level [V]
        dx2/dt =  k2 sqrt(x1) - k3 sqrt(x2) lower level [V]
        y      =  x2

    The first guess of the constants (0.05) empties a tank of 5 V in about 90 s, the time scale of the record.
    """  # noqa: D400
    source = "first guess; to be fitted"
    return Model(
        name="cascaded-tanks",
        states=(
            Quantity("upper_level", "V", "level of the upper tank", 0.0, 20.0, 5.0),
            Quantity("lower_level", "V", "level of the lower tank", 0.0, 20.0, 5.0),
        ),
        inputs=(Quantity("pump_voltage", "V", "pump voltage", -1.0, 15.0, 1.0),),
        parameters=(
            Parameter("upper_outflow", 0.05, "V^0.5/s", source, "k1", 0.0, 1.0, 0.05, role="estimated"),
            Parameter("lower_inflow", 0.05, "V^0.5/s", source, "k2", 0.0, 1.0, 0.05, role="estimated"),
            Parameter("lower_outflow", 0.05, "V^0.5/s", source, "k3", 0.0, 1.0, 0.05, role="estimated"),
            Parameter("pump_gain", 0.05, "1/s", source, "k4", 0.0, 1.0, 0.05, role="estimated"),
        ),
        outputs=(Quantity("level", "V", "measured level of the lower tank", 0.0, 12.0, 1.0),),
        max_step_s=2.0,
        known_effects=KNOWN_EFFECTS,
        edges=("level",),
        equations=_equations,
        initial_guess={"upper_level": 5.0, "lower_level": 5.0},
        starts_steady=False,
    )


def _equations(m: Scope) -> None:
    upper, lower = m.state("upper_level"), m.state("lower_level")
    pumped = m.site("pump_flow", m.parameter("pump_gain") * m.input("pump_voltage"), "actuator", unit="V/s")
    root = ca.sqrt(ca.fmax(upper, _DRY))
    out = m.site("upper_outflow", m.parameter("upper_outflow") * root, "flow", unit="V/s")
    into = m.site("lower_inflow", m.parameter("lower_inflow") * root, "flow", unit="V/s")
    away = m.site("lower_outflow", m.parameter("lower_outflow") * ca.sqrt(ca.fmax(lower, _DRY)), "flow", unit="V/s")
    m.derivative("upper_level", pumped - out)
    m.derivative("lower_level", into - away)
    m.output("level", m.site("level_sensor", lower, "sensor", "offset", unit="V"))


@dataclass(frozen=True)
class PumpingEconomics:
    """A lower level is worth something and pumping costs power: the contract `Economics`.

    The power of a pump grows with the cube of its speed (affinity laws), here of its voltage u [V]. At rest the level
    is (k2 k4 / (k1 k3))^2 u^2; where k2 k4 = k1 k3, the best voltage is u = 2 level / (3 pumping). Prices are chosen.

    Attributes
    ----------
    level
        Worth of the lower level [cu/(V s)].
    pumping
        Price of pumping, by the cube of the voltage [cu/(V3 s)].
    """

    level: float = 1.0
    pumping: float = 0.25
    terms: ClassVar[tuple[str, ...]] = ("level", "pumping")
    typical_rate: ClassVar[float] = 1.0

    def prices(self) -> list[float]:
        """Prices in the order of the fields."""
        return [self.level, self.pumping]

    def rates(self, point: OperatingPoint, prices: Any) -> dict[str, Any]:
        """Rate of each term [cu/s]."""
        return {
            "level": prices[0] * point.output("level"),
            "pumping": -prices[1] * point.input("pump_voltage") ** 3,
        }


def read_benchmark(path: Source) -> tuple[Dataset, Dataset]:
    """Read the published file: estimation record (uEst, yEst) and validation record (uVal, yVal).

    The file samples input and output at the same instant and holds the input *after* it. A `Dataset` wants the input
    held *before* each row. So the inputs move down by one row; the first row's is never used.

    Raises
    ------
    DataError
        A column or the sampling interval is missing, or a cell is empty.
    RangeError
        A voltage outside the range of the pump.
    """
    file, table = named(path), read_table(path)
    missing = [c for c in BENCHMARK_COLUMNS if c not in table.columns]
    if missing:
        raise DataError(f"{file}: column {missing[0]!r} is missing; the cascaded-tanks file has {BENCHMARK_COLUMNS}")
    dt = float(numeric_column(table, "Ts", file)[0])
    if not dt > 0:
        raise DataError(f"{file}: Ts = {dt} in its first row; give the sampling interval in seconds")
    records, model = [], make_model()
    for name in ("Est", "Val"):
        u, y = (numeric_column(table, column + name, file) for column in ("u", "y"))
        if not np.isfinite(u).all():
            raise DataError(f"{file}: column 'u{name}' has an empty cell; inputs can not be missing")
        held = np.concatenate([u[:1], u[:-1]])
        time = dt * np.arange(len(u), dtype=float)
        record = Dataset(f"{file.stem}:{name}", time, dt, held[:, None], y[:, None])
        records.append(check_record(record, model, table, file))
    return records[0], records[1]


PROCESS = Process("cascaded-tanks", make_model, lambda source: Measurements(*read_benchmark(source)))
