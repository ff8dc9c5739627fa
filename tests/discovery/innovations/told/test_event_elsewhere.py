"""Protects an event of a free run beside what acts where the model has no site, with the same shape in time.

A chamber that leaks from some time on was named "positioner fell by 6.8 % from 305 s". The records are those of a
benchmark whose plants share no code with the package.
"""

from __future__ import annotations

from dataclasses import replace

from adaptive_flot.discovery.discover import discover
from adaptive_flot.discovery.innovations.places.free_run import _changes
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.processes.registry import read_measurements
from benchmarks.other_processes.record import make_record
from benchmarks.other_processes.without_a_site import WITHOUT_A_SITE, vessel
from benchmarks.other_processes.without_a_site.valve import make_model

LEAKING = (71, 10)
"""Seed and number of a record of a valve whose chamber leaks from 305 s on."""
BYPASS = (1009, 4)
"""... of a vessel, and of gas that comes in beside its valve and its meter."""


def test_a_chamber_that_leaks_from_some_time_on_is_no_positioner() -> None:
    made = make_record(*LEAKING, WITHOUT_A_SITE)
    assert made.answer["case"] == "leaking chamber" and made.reference is None
    found = discover(make_model(), read_measurements(made.table, make_model()).record).verdict
    assert found.word == "abstain"
    assert "as if chamber lost a share of itself (from 305 s on)" in found.reason


def test_gas_that_comes_in_unseen_is_no_smaller_outlet_for_sure() -> None:
    """Before, "outlet is 0.0138 bar/s less from 2860 s on" was named. That much more may come from anywhere."""
    made = make_record(*BYPASS, WITHOUT_A_SITE)
    assert made.answer["case"] == "bypass" and made.reference is None
    found = discover(vessel.make_model(), read_measurements(made.table, vessel.make_model()).record).verdict
    assert found.word == "class"
    assert found.members == (("outlet", "time"), ("balance of pressure", "time"))


STILL = {"amplitude": 0.0, "onset": 50.0, "duration": 9.0}
RAMP = Effect("pump", "time", "ramp", {"amplitude": -0.3, "onset": 50.0, "duration": 9.0})
BENT = Effect("pump", "level", "curve", {"value_1": 0.1}, {"knots": (0.0, 1.0)})


def test_an_event_starts_from_nothing_at_its_times() -> None:
    constant, event = _changes("balance of level", "offset", RAMP, ("amplitude", "onset"))
    assert constant[0].form == "shift" and constant[1] == ("amplitude",)
    assert event == (replace(RAMP, site="balance of level", mode="offset", coefficients=STILL), ("amplitude", "onset"))


def test_what_depends_on_a_signal_has_a_constant_beside_it_only() -> None:
    assert [e.form for e, _ in _changes("balance of level", "offset", BENT, ("value_1",))] == ["shift"]
