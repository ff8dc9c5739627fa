"""The generator's cell is the cell of the paper when nothing is hidden in it."""

import ast
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from benchmarks.hidden_effects.cell import constants as c
from benchmarks.hidden_effects.cell.equations import World
from benchmarks.hidden_effects.cell.simulate import replay, steady_state
from benchmarks.hidden_effects.cell.sites import INPUTS, OUTPUTS

PACKAGE = Path(c.__file__).parent


@pytest.mark.parametrize(("name", "rows"), [("steps", 900), ("scenario1", 600), ("scenario2", 600)])
def test_the_nominal_generator_agrees_with_the_reference(
    shared_file: Callable[[str], Path], name: str, rows: int
) -> None:
    """An independent implementation of the model page with tight tolerances, to 1e-5 of each column's largest value."""
    table = pd.read_csv(shared_file(f"reference/{name}.csv"))
    first = table.iloc[0]
    start = [first["tails_flow_m3_s"] - c.LEVEL_GAIN * first["level_m"], first["level_m"]]
    start += [first[f"gas_ratio_{k}"] for k in range(1, 6)] + [first["m_valuable_kg"], first["m_gangue_kg"]]
    got = replay(World(), table[list(INPUTS)].to_numpy()[1 : rows + 1], start)
    for column in (*OUTPUTS, "recovery", "alpha_star"):
        want = table[column].to_numpy()
        np.testing.assert_allclose(got[column], want[1 : rows + 1], rtol=0.0, atol=1e-5 * np.abs(want).max())


def test_the_numbers_are_those_of_the_published_cell(shared_file: Callable[[str], Path]) -> None:
    """The copy by hand has no slip."""
    cell = yaml.safe_load(shared_file("model/cell_87l.yaml").read_text())
    pairs = {
        ("cell", "cross_section_area"): c.AREA,
        ("cell", "volume"): c.CELL_VOLUME,
        ("cell", "height"): c.CELL_HEIGHT,
        ("bubbles", "diameter"): list(c.BUBBLE_DIAMETERS),
        ("bubbles", "number"): list(c.BUBBLE_NUMBERS),
        ("froth", "growth_exponent"): c.GROWTH_EXPONENT,
        ("froth", "coalescence_rate"): c.COALESCENCE_RATE,
        ("froth", "burst_a"): c.BURST[0],
        ("froth", "burst_b"): c.BURST[1],
        ("froth", "drag_coefficient"): c.DRAG,
        ("froth", "plateau_border"): c.PLATEAU_BORDER,
        ("froth", "peclet"): c.PECLET,
        ("minerals", "floatability"): list(c.FLOATABILITY),
        ("minerals", "particle_diameter"): list(c.PARTICLE_DIAMETERS),
        ("minerals", "density"): list(c.MINERAL_DENSITIES),
        ("minerals", "feed_concentration"): list(c.FEED_CONCENTRATIONS),
        ("level_loop", "proportional_gain"): c.LEVEL_GAIN,
        ("level_loop", "integral_time"): c.LEVEL_INTEGRAL_TIME,
        ("operation", "air_flow_limits"): list(c.AIR_LIMITS),
        ("operation", "level_limits"): list(c.LEVEL_LIMITS),
    }
    assert {key: cell[key[0]][key[1]]["value"] for key in pairs} == pairs


def test_a_cell_at_rest_stays_at_rest() -> None:
    """The steady state from gas and mass balances is one of the differential equations."""
    inputs = np.tile([1.5e-3, c.FEED_FLOW, 0.38], (1200, 1))
    out = replay(World(), inputs, steady_state(inputs[0], World()))
    assert np.ptp(out["level_m"]) < 1e-6
    assert np.ptp(out["tails_flow_m3_s"][600:]) < 1e-9


def test_the_package_shares_nothing_with_what_it_judges() -> None:
    """Apart from errors and file writing, no module of the product is imported: equations and forms are its own."""
    allowed = {"adaptive_flot.errors", "adaptive_flot.files"}
    for file in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                top = name.split(".")[0]
                assert top not in ("casadi", "controllers", "estimators"), f"{file.name} imports {name}"
                assert top != "adaptive_flot" or name in allowed, f"{file.name} imports {name}"
