"""Records of other processes: a seed gives the same ones, a plant without extras is its model, answers are scored."""

import numpy as np
import pandas as pd
import pytest

from adaptive_flot.discovery.further_sites.places import with_further_sites
from adaptive_flot.greybox.stepping.record import RecordSimulator
from adaptive_flot.processes.registry import make_model, read_measurements
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict
from benchmarks.other_processes.further import FURTHER
from benchmarks.other_processes.plants import PROCESSES
from benchmarks.other_processes.process import NOTHING, Process
from benchmarks.other_processes.record import case_of, make_record, simulate
from benchmarks.other_processes.without_a_site import WITHOUT_A_SITE
from benchmarks.plant_like.score import outcome

CONSTANTS = {
    "heated_box": {"conductance": 1.1, "capacity": 700.0},
    "building": {"conductance": 130.0, "capacity": 6.0},
    "dc_motor": {"gain": 40.0, "damping": 5.0},
    "level_tank": {"supply": 10.0, "discharge": 9.0},
    "heat_exchanger": {"ua": 2.5, "holdup": 50.0},
    "mixing_tank": {"feed_strength": 12.0, "stock": 220.0, "volume": 1200.0},
    "two_tanks": {"pump_gain": 0.1, "k1": 0.16, "k2": 0.15},
    "room_air": {"fan_air": 350.0, "infiltration": 60.0, "breath": 0.018},
    "fan_filter": {"head": 900.0, "filter_drop": 60.0, "duct_drop": 22.0, "inertia": 600.0},
    "dosing": {"decay": 0.6, "volume": 25.0},
    "battery": {"capacity": 2.0, "ohms": 0.05, "empty": 3.3, "rise": 0.8},
    "spring": {"gain": 28.0, "stiffness": 13.0, "damping": 1.2},
    "dryer": {"watts": 280.0, "air": 9.0, "conductance": 1.2, "store": 50.0},
    "reactor": {"speed": 0.1, "heat": 28.0, "transfer": 0.13},
    "vessel": {"kv": 0.055, "drain": 0.045},
    "block": {"conductance": 2.3},
    "valve": {"air": 1.7, "kv": 22.0},
    "basin": {"pump": 0.011, "decay": 2.2e-4},
}
"""Of the plants, without what is off."""
FIRST = {"battery": [0.5], "spring": [0.0, 0.0], "valve": [1.4, 0.5]}
"""State in the first row, where no output shows it."""
SETS = (PROCESSES, FURTHER, WITHOUT_A_SITE)


def said(word: str, *names: tuple[str, str]) -> SubmittedVerdict:
    told = [{"site": site, "driver": driver} for site, driver in names]
    return SubmittedVerdict.model_validate({"verdict": word, ("class" if word == "class" else "effects"): told})


@pytest.mark.parametrize("process", [p for some in SETS for p in some], ids=lambda p: p.name)
def test_a_plant_without_extras_is_its_model(process: Process) -> None:
    """The plant's own steps of Euler against the model: no error of a sign, a unit or a row between the two."""
    columns = simulate(process, np.random.SeedSequence(1).spawn(4), 300, NOTHING, False, rich=0.0)
    table = pd.DataFrame({"time_s": process.dt * (1.0 + np.arange(300))} | columns)
    model = process.make_model().with_parameters(CONSTANTS[process.name])
    record = read_measurements(table, model).record
    shown = [columns[c][0] for c in process.noise][: len(model.states)]
    first = np.array(FIRST.get(process.name, shown))
    run = RecordSimulator(model, record.dt).outputs(record, first, model.parameter_values)
    assert np.abs(run - record.outputs).max() < 0.01 * np.ptp(record.outputs, axis=0).max()


def test_a_record_is_the_same_whenever_it_is_made_and_its_reference_is_of_the_same_plant() -> None:
    a, b = make_record(3, 2), make_record(3, 2)
    assert a.answer == b.answer and a.reference is not None and b.reference is not None
    pd.testing.assert_frame_equal(a.table, b.table)
    pd.testing.assert_frame_equal(a.reference, b.reference)
    assert len(a.reference) < len(a.table)


def test_every_case_names_sites_of_its_model_and_comes_up_with_and_without_a_reference() -> None:
    for processes in SETS:
        count = len(processes)
        for i, process in enumerate(processes):
            for case in process.cases.values():
                model = make_model(f"{process.make_model.__module__}:{case.model}")
                sites = {site.name for site in with_further_sites(model).sites}
                assert {site for site, _ in (*case.names, *process.tolerated)} <= sites
            assert {case_of(process, 1, k, count) for k in range(i, 40 * count, count)} == set(process.cases)


def test_what_a_plant_has_all_the_time_is_no_wrong_name_and_no_change_since_a_reference() -> None:
    alone, referred = make_record(5, 10).answer, make_record(5, 2).answer
    assert outcome(alone, said("named", ("loss", "air"))) == "tolerated"
    assert outcome(alone, said("named", ("heater", "saturation"))) == "false_alarm"
    assert outcome(referred, said("named", ("friction", "speed"))) == "false_alarm"


def test_where_a_model_has_no_site_a_name_is_wrong_and_the_place_in_a_class_is_right() -> None:
    """No record of that set whose truth is a place takes a site of the model for it, but what does the same."""
    answers = [make_record(1, k, WITHOUT_A_SITE).answer for k in range(12)]
    placed = next(a for a in answers if a["effects"] and a["effects"][0]["site"].startswith("balance of "))
    place = (placed["effects"][0]["site"], placed["effects"][0]["driver"])
    own = {"basin": "inflow", "block": "heater", "vessel": "valve", "valve": "positioner"}[placed["process"]]
    assert outcome(placed, said("class", (own, "time"), place)) == "right_class"
    assert outcome(placed, said("named", (own, "time"))) == "wrong_name"
    assert outcome(placed, said("abstain")) == "abstained"
