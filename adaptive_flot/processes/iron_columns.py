"""Reverse flotation of iron ore in columns: a small first-principles model for a public record of an industrial plant.

Data: E. Magalhaes, "Quality Prediction in a Mining Process" (Kaggle, 2017), hourly means. Silica floats off with the
amine that covers it; iron oxide, depressed by starch, sinks to the concentrate. Seven columns work in two groups (1 to
3 and 4 to 7), whose levels move together.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np
import pandas as pd

from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.columns import date_column, numeric_column
from adaptive_flot.greybox.data.dataset import Dataset, check_record
from adaptive_flot.greybox.data.tables import Source, named, read_table
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.quantities import KnownEffect
from adaptive_flot.processes.process import Measurements, Process

HOUR = 3600.0
HEMATITE = 159.69 / (2 * 55.845)
"""Mass of Fe2O3 a mass of iron."""
FIRST_HOUR = "2017-04-11 10:00"
"""Before it two of the air flows are held at one value (a data hold), and earlier still there is a plant stop."""
HELD_HOURS = 6
"""An assay that repeats itself for so long is a laboratory that is off."""
LONGEST_LAG = 6 * HOUR
"""Minutes in the columns, and one to two hours until a sample is analysed: more is no lag of this plant."""
GROUPS = ((1, 2, 3), (4, 5, 6, 7))
_AIR, _AMINE, _STARCH, _SOLIDS, _DEPTH = 300.0, 490.0, 2900.0, 200.0, 0.4
"""Usual air of a column [Nm3/h], reagents (scaled), solids [t/h] and froth level [m]: the rates hold there."""
_SILICA_FEED, _IRON_FEED = 0.15, 0.56
_SOLID_DENSITY = 4.0  # t/m3, between hematite (5.2) and quartz (2.65)

KNOWN_EFFECTS = (
    KnownEffect("silica_rate", "time", "silica that floats otherwise: ore type, amine quality"),
    KnownEffect("silica_rate", "ph", "collector that depends on the pH"),
    KnownEffect("silica_rate", "amine_flow", "coverage by the collector that is not the model's"),
    KnownEffect("silica_rate", "air_1", "bubbles that grow with air"),
    KnownEffect("silica_rate", "air_2", "bubbles that grow with air"),
    KnownEffect("silica_rate", "pulp_density", "flotation hindered by thick pulp"),
    KnownEffect("silica_rate", "pulp_flow", "residence time that is not the model's"),
    KnownEffect("silica_rate", "silica_feed", "coarse or locked silica that comes with poor ore"),
    KnownEffect("froth_recovery", "level_1", "froth recovery that depends otherwise on the froth's depth"),
    KnownEffect("froth_recovery", "level_2", "froth recovery that depends otherwise on the froth's depth"),
    KnownEffect("iron_rate", "time", "iron that is lost otherwise: slimes, starch quality"),
    KnownEffect("iron_rate", "starch_flow", "depression that is not the model's"),
    KnownEffect("iron_rate", "ph", "depression that depends on the pH"),
    KnownEffect("silica_feed", "time", "feed grade that is not what the held assay says"),
    KnownEffect("silica_feed", "constant", "feed assay with an offset or gain error"),
    *(KnownEffect(s, d, f"{s.replace('_', ' ')}: {w}") for s in ("silica_assay", "iron_assay")
      for d, w in (("constant", "offset or gain error"), ("time", "drift"), ("lag", "slow"), ("delay", "dead time"))),
)  # fmt: skip


def make_model() -> Model:
    """Two groups of well-mixed columns in series, quasi-steady over an hour, and one lag of plant and sample::

        x   = mean + b (assay - mean)                  feed: an assay that is held for hours to weeks is half believed
        theta = a / (a + a50)                          coverage, a: amine a tonne of silica, relative
        q_g   = K (air_g / 300) (200 / F) exp(-l (level_g - 0.4)) theta       k tau of silica in group g
        p_g   = D (air_g / 300) (200 / F) exp(-l (level_g - 0.4)) / (1 + starch)   of iron oxide
        S     = x_s / ((1 + q_1)(1 + q_2)),  H = x_h / ((1 + p_1)(1 + p_2))     silica, iron oxide
        O     = (1 - x_s - x_h) / ((1 + w q_1)(1 + w q_2))                      other minerals
        silica = S / (S + H + O),  iron = H / 1.43 / (S + H + O);   each through a lag T

    Well-mixed first-order flotation: Finch & Dobby, *Column Flotation* (1990), section 4.2; rates proportional to the
    bubble surface area flux, here to the air.
    """  # noqa: D400
    guess = "first guess; to be fitted"
    share = ("-", 0.0, 1.0)
    return Model(
        name="iron-columns",
        states=(
            Quantity("silica", "-", "silica in the concentrate as it is sampled", 0.0, 1.0, 0.01),
            Quantity("iron", "-", "iron in the concentrate as it is sampled", 0.0, 1.0, 0.01),
        ),
        inputs=(
            Quantity("silica_feed", share[0], "silica in the feed", *share[1:], 0.05, movable=False),
            Quantity("iron_feed", share[0], "iron in the feed", *share[1:], 0.05, movable=False),
            Quantity("starch_flow", "-", "starch, scaled", 0.0, 1e5, 1000.0),
            Quantity("amine_flow", "-", "amine, scaled", 0.0, 1e5, 100.0),
            Quantity("pulp_flow", "t/h", "pulp", 1.0, 1e4, 10.0),
            Quantity("ph", "-", "pH of the pulp", 0.0, 14.0, 0.5, movable=False),
            Quantity("pulp_density", "t/m3", "density of the pulp", 1.01, 4.0, 0.1, movable=False),
            Quantity("air_1", "m3/h", "mean air of columns 1 to 3, normal", 0.0, 1e4, 30.0),
            Quantity("air_2", "m3/h", "mean air of columns 4 to 7, normal", 0.0, 1e4, 30.0),
            Quantity("level_1", "m", "mean froth level of columns 1 to 3", 0.0, 10.0, 0.1),
            Quantity("level_2", "m", "mean froth level of columns 4 to 7", 0.0, 10.0, 0.1),
        ),
        parameters=(
            Parameter("silica_rate", 4.0, "-", guess, "K", 0.01, 100.0, 1.0, role="estimated"),
            Parameter("iron_rate", 0.1, "-", guess, "D", 0.0, 10.0, 0.05, role="estimated"),
            Parameter("half_coverage", 1.0, "-", guess, "a50", 0.001, 100.0, 0.5, role="estimated"),
            Parameter("froth_decay", 0.5, "1/m", guess, "l", -20.0, 20.0, 0.5, role="estimated"),
            Parameter("lag", 2 * HOUR, "s", guess, "T", 600.0, LONGEST_LAG, HOUR, role="estimated"),
            Parameter("feed_trust", 0.5, "-", guess, "b", 0.0, 1.0, 0.3, role="estimated"),
            Parameter("other_rate", 0.5, "-", guess, "w", 0.0, 5.0, 0.3, role="estimated"),
        ),
        outputs=(
            Quantity("silica", "-", "silica in the concentrate", 0.0, 1.0, 0.01),
            Quantity("iron", "-", "iron in the concentrate", 0.0, 1.0, 0.01),
        ),
        equations=_equations,
        max_step_s=HOUR / 2,
        initial_guess={"silica": 0.023, "iron": 0.65},
        starts_steady=False,
        known_effects=KNOWN_EFFECTS,
    )


def _equations(m: Scope) -> None:
    density = m.input("pulp_density")
    solids = m.input("pulp_flow") * (1 - 1 / density) / (1 - 1 / _SOLID_DENSITY)
    trust = m.parameter("feed_trust")
    believed = _SILICA_FEED + trust * (m.input("silica_feed") - _SILICA_FEED)
    silica = m.site("silica_feed", believed, "feed")
    oxide = (_IRON_FEED + trust * (m.input("iron_feed") - _IRON_FEED)) * HEMATITE
    amine = m.site("amine_flow", m.input("amine_flow"), "actuator") / _AMINE * (0.15 * _SOLIDS) / (silica * solids)
    starch = m.site("starch_flow", m.input("starch_flow"), "actuator") / _STARCH
    covered = amine / (amine + m.parameter("half_coverage"))
    rate = m.site("silica_rate", m.parameter("silica_rate") * covered)
    lost = m.site("iron_rate", m.parameter("iron_rate") / (1 + starch))
    silica_left, oxide_left, other_left = silica, oxide, ca.fmax(1 - silica - oxide, 0)
    for g in (1, 2):
        air = m.site(f"air_{g}", m.input(f"air_{g}"), "actuator") / _AIR
        froth = m.site("froth_recovery", ca.exp(-m.parameter("froth_decay") * (m.input(f"level_{g}") - _DEPTH)))
        strength = air * froth * _SOLIDS / solids
        silica_left = silica_left / (1 + rate * strength)
        oxide_left = oxide_left / (1 + lost * strength)
        other_left = other_left / (1 + m.parameter("other_rate") * rate * strength)
    total = silica_left + oxide_left + other_left
    lag = m.parameter("lag")
    for name, value in (("silica", silica_left / total), ("iron", oxide_left / HEMATITE / total)):
        m.derivative(name, (value - m.state(name)) / lag)
        m.output(name, m.site(f"{name}_assay", m.state(name), "sensor", "offset"))


def read_record(path: Source) -> Dataset:
    """Read `hourly.csv` from FIRST_HOUR on; concentrate assays that are held for HELD_HOURS or more are missing.

    Row k holds the means of the hour that ends at its time.

    Raises
    ------
    DataError
        A column is missing, an input is empty, or an hour.
    RangeError
        An input outside its physical range.
    """
    file, table = named(path), read_table(path)
    if "hour" not in table.columns:
        raise DataError(f"{file}: column 'hour' is missing; give the hourly table of the mining plant")
    hour = date_column(table, "hour", file)
    table = table[(hour >= pd.Timestamp(FIRST_HOUR)).to_numpy()]
    hour = hour[hour >= pd.Timestamp(FIRST_HOUR)]
    if len(table) < 2 or (hour.diff().dropna() != pd.Timedelta(hours=1)).any():
        raise DataError(f"{file}: not one row an hour from {FIRST_HOUR} on; give the hourly table of the mining plant")

    def column(name: str) -> FloatArray:
        if name not in table.columns:
            raise DataError(f"{file}: column {name!r} is missing; give the hourly table of the mining plant")
        return numeric_column(table, name, file)

    def mean(name: str, columns: Sequence[int]) -> FloatArray:
        mean: FloatArray = np.mean([column(f"{name}_{k:02d}") for k in columns], axis=0)
        return mean

    plain = ("starch_flow", "amine_flow", "pulp_flow", "pulp_ph", "pulp_density")
    inputs = [column("silica_feed_pct") / 100, column("iron_feed_pct") / 100, *map(column, plain)]
    inputs += [mean("air", g) for g in GROUPS] + [mean("level", g) / 1000 for g in GROUPS]
    outputs = np.column_stack([fresh(column(f"{name}_conc_pct")) / 100 for name in ("silica", "iron")])
    time = HOUR * np.arange(1.0, len(table) + 1)
    return check_record(Dataset(file.stem, time, HOUR, np.column_stack(inputs), outputs), make_model(), table, file)


def fresh(assay: FloatArray) -> FloatArray:
    """An assay (N,) without its held values: NaN after the first of HELD_HOURS or more equal ones."""
    change = np.concatenate([[True], np.diff(assay) != 0])
    spell = np.cumsum(change)
    length = np.bincount(spell)[spell]
    return np.where((length >= HELD_HOURS) & ~change, np.nan, assay)


PROCESS = Process("iron-columns", make_model, lambda source: Measurements(read_record(source)))
