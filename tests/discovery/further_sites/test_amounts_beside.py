"""Protects an amount beside a factor: a seat that no longer closes, told as the flow meter behind it.

The valve is simulated here by Euler's rule, apart from the package.
"""

from __future__ import annotations

import re

import casadi as ca
import numpy as np
import pytest

from adaptive_flot.discovery.further_sites.places import AMOUNT, further_sites, is_part, is_possible, with_further_sites
from adaptive_flot.discovery.further_sites.same_meaning import is_meant, is_same_part
from adaptive_flot.discovery.further_sites.wording import change_in_words
from adaptive_flot.discovery.hypotheses.procedure import compare
from adaptive_flot.greybox import Dataset, Effect, Model, Parameter, Quantity, Scope

DT, ROWS, STEPS = 0.5, 700, 5
KV, TAU, SEAT = 22.0, 1.0, 3.0


def valve() -> Model:
    """A valve in a pipe: its stem follows the command, and the flow its opening and the difference of pressures."""

    def equations(m: Scope) -> None:
        x = m.state("stem")
        m.derivative("stem", (m.site("positioner", m.input("command"), "actuator", unit="-") - x) / TAU)
        opening = m.site("opening", m.parameter("kv") * x, unit="m3/h/bar0.5")
        factor = m.site("density", m.parameter("density"), unit="-")
        flow = opening * factor * ca.sqrt(ca.fmax(m.input("difference"), 0.01))
        m.output("position", m.site("position_sensor", x, "sensor", "offset", unit="-"))
        m.output("flow", m.site("flow_meter", flow, "sensor", unit="m3/h"))

    return Model(
        name="valve",
        states=(Quantity("stem", "-", "", -0.2, 1.3, scale=0.1),),
        inputs=(Quantity("command", "-", "", 0.0, 1.0), Quantity("difference", "bar", "", 0.0, 20.0, movable=False)),
        parameters=(
            Parameter("kv", 20.0, "m3/h/bar0.5", "", "", 2.0, 80.0, 2.0, role="estimated"),
            Parameter("density", 1.0, "-", "", "", 0.5, 2.0, 0.1, role="fixed"),
        ),
        outputs=(Quantity("position", "-", "", -0.3, 1.4), Quantity("flow", "m3/h", "", -5.0, 200.0)),
        equations=equations,
        max_step_s=0.25,
        initial_guess={"stem": 0.5},
        starts_steady=False,
    )


def record(seed: int, seat: float = 0.0, meter: float = 1.0) -> Dataset:
    """A record of a valve that passes more at any opening [m3/h/bar0.5], or whose meter shows more."""
    rng = np.random.default_rng(seed)
    command = np.repeat(rng.uniform(0.2, 0.9, ROWS // 14), 14)
    pressure, x, seen = 3.5 + np.cumsum(0.05 * rng.normal(size=ROWS)), 0.5, np.zeros((ROWS, 2))
    pressure = np.clip(pressure, 1.5, 6.0)
    for k in range(ROWS):
        for _ in range(STEPS if k else 0):
            x += DT / STEPS * (command[k] - x) / TAU
        seen[k] = x, meter * (KV * x + seat) * np.sqrt(pressure[k])
    noise = rng.normal(size=(ROWS, 2)) * (0.003, 0.25)
    return Dataset("valve", DT * np.arange(ROWS, dtype=float), DT, np.column_stack([command, pressure]), seen + noise)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_worn_seat_is_no_meter_for_sure(seed: int) -> None:
    """Before, the meter had the name: "wrongly calibrated, +5 m3/h in the middle of its range"."""
    found = compare(valve(), [record(10 + seed, seat=SEAT)], [record(seed)]).verdict
    assert found.word in ("abstain", "class"), found.reason
    said = re.search(r"as if opening were (\S+) m3/h/bar0.5 larger at any value", found.reason)
    assert said is not None, found.reason
    assert float(said[1]) == pytest.approx(SEAT, rel=0.05)


def test_a_meter_that_shows_more_has_no_such_rival() -> None:
    found = compare(valve(), [record(10, meter=1.15)], [record(0)]).verdict
    assert found.word == "class" and {site for site, _ in found.members} <= {"flow_meter", "opening", "density"}


def test_what_no_input_or_state_moves_has_no_such_place() -> None:
    """An amount beside a constant is a factor of it."""
    places = {s.name for s in further_sites(with_further_sites(valve())) if s.name.startswith(AMOUNT)}
    assert places == {"amount at opening"}


def test_what_is_asked_of_an_actuator_is_the_same_part_and_what_others_read_is_not() -> None:
    """A clogged strainer was told as a valve "0.104 less than the record says: the model has no site for that"."""
    model = valve()
    assert is_same_part(model, "reading of command", "positioner")
    assert is_same_part(model, "amount at opening", "opening")
    assert not is_same_part(model, "reading of difference", "positioner")
    assert not is_same_part(model, "reading of command", "opening")  # a function of the state that the command moves
    assert not is_same_part(model, "balance of stem", "positioner")


def test_an_amount_is_part_of_its_site_and_of_no_other() -> None:
    model = with_further_sites(valve())
    assert is_part("amount at opening", "opening") and not is_part("amount at opening", "positioner")
    shift = [Effect(site, "constant", "shift", mode="factor") for site in ("opening", "positioner", "density")]
    assert [is_meant(model, e, "amount at opening") for e in shift] == [True, False, False]
    assert change_in_words(model, "amount at opening", -2.0, "", measured=False) == (
        "opening were by an amount smaller at any value"
    )


@pytest.mark.parametrize(
    ("low", "high", "amount", "can_be"),
    [
        (0.0, 9.0, 3.0, True),  # a seat that leaks
        (0.0, 9.0, -3.0, False),  # a heater that gives less than nothing
        (-9.0, 0.0, 3.0, False),
        (4.0, 9.0, -3.0, True),
        (-5.0, 9.0, -30.0, True),  # it has had both signs
    ],
)
def test_what_has_had_one_sign_keeps_it(low: float, high: float, amount: float, can_be: bool) -> None:
    value = np.linspace(low, high, 101)
    assert is_possible(valve(), record(0), "amount at opening", amount, value) == can_be


def test_no_store_is_a_million_times_as_large() -> None:
    """That would be one whose state does not move."""
    value = np.zeros(9)
    assert is_possible(valve(), record(0), "rate of stem", -np.log(3.0), value)
    assert not is_possible(valve(), record(0), "rate of stem", -np.log(1e7), value)
