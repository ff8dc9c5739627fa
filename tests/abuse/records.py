"""A small model with a sound record of its own, sound records of the published forms, and what a refusal must be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.processes import cascaded_tanks, iron_columns, zinc_level


def _equations(m: Scope) -> None:
    m.derivative("depth", m.input("inflow") - m.parameter("discharge") * m.state("depth"))
    m.output("level", m.state("depth"))


TANK = Model(
    name="tank",
    states=(Quantity("depth", "m", ""),),
    inputs=(Quantity("inflow", "m3/s", "", 0.0, 1.0),),
    parameters=(Parameter("discharge", 0.5, "m2/s", "", symbol="k"),),
    outputs=(Quantity("level", "m", ""),),
    equations=_equations,
)
N = 6
GOOD = pd.DataFrame({"time_s": 2.0 * np.arange(N), "inflow_m3_s": 0.1, "level_m": 1.0 + np.arange(N)})
HOURS = pd.date_range(iron_columns.FIRST_HOUR, periods=4, freq="h")
IRON = pd.DataFrame(
    {"hour": HOURS.astype(str), "silica_feed_pct": 15.0, "iron_feed_pct": 56.0, "starch_flow": 2900.0}
    | {"amine_flow": 490.0, "pulp_flow": 400.0, "pulp_ph": 9.8, "pulp_density": 1.7}
    | {f"air_{k:02d}": 300.0 for k in range(1, 8)}
    | {f"level_{k:02d}": 400.0 for k in range(1, 8)}
    | {"silica_conc_pct": [2.0, 2.1, 2.2, 2.3], "iron_conc_pct": 65.0}
)
ZINC = pd.DataFrame(
    {zinc_level.TIME: [f"01/02/2020 00:0{k}:00" for k in range(4)]}
    | {column: 10.0 + k for k, column in enumerate(zinc_level.COLUMNS.values())}
)
TANKS = pd.DataFrame({"uEst": [1.0] * 4, "yEst": 2.0, "uVal": 1.0, "yVal": 2.0, "Ts": [4.0, *[np.nan] * 3]})
PUBLISHED: dict[str, tuple[Callable[[Path], object], pd.DataFrame]] = {
    "iron": (iron_columns.read_record, IRON),
    "zinc": (zinc_level.read_record, ZINC),
    "tanks": (cascaded_tanks.read_benchmark, TANKS),
}


def one_line(message: str, file: Path) -> str:
    assert message.startswith(str(file)), message
    assert len(message.splitlines()) == 1 and len(message) < 1000, message
    return message


def refusal(read: Callable[[], object], file: Path) -> str:
    with pytest.raises(AdaptiveFlotError) as caught:
        read()
    return one_line(str(caught.value), file)
