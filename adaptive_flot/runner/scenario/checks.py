"""What one key of a scenario alone does not show: times that do not fit, names the model does not have, ranges."""

from __future__ import annotations

from adaptive_flot.errors import ScenarioError, located, near_match
from adaptive_flot.greybox.data.tables import MOST_ROWS
from adaptive_flot.greybox.stepping.step_functions import check_interval
from adaptive_flot.runner.scenario.discovery_options import FEWEST
from adaptive_flot.runner.scenario.faults import ControllerFault, SlowAnalyser, Stuck
from adaptive_flot.runner.scenario.inputs.recorded import Recorded
from adaptive_flot.runner.scenario.realisation import Realisation
from adaptive_flot.runner.scenario.scenario import Scenario

MOST_INTERVALS = MOST_ROWS
"""Longest run: what it writes can be read again."""


def check_scenario(scenario: Scenario) -> None:
    """Check a scenario as a whole.

    Raises
    ------
    ScenarioError
        Times, limits, cases or disturbances that do not fit.
    ModelError, RangeError
        Names that the model does not have, values outside its range.
    """
    _check_times(scenario)
    _check_plant(scenario)
    file, model = scenario.file, scenario.model
    columns = [q.column for q in model.inputs]
    for key in file.inputs:
        if key not in columns:
            raise ScenarioError(f"inputs: unknown input {key!r}; {near_match(key, columns)}")
    for column in columns:
        if column not in file.inputs:
            raise ScenarioError(f"inputs: {column!r} is missing; give its profile")
    for key, profile in file.inputs.items():
        if isinstance(profile, Recorded):
            with located(f"inputs.{key}"):
                profile.check(file.duration_s, file.sampling_s)
    model.indices("outputs", file.measurements)
    with located("initial_estimate.guess"):
        model.with_parameters(file.initial_estimate.guess)
    realisations = [Realisation(scenario, seed) for seed in file.seeds]
    for realisation in realisations:
        _check_parameters(realisation)
    _check_closed_loop(scenario)
    _check_initial_state(scenario)
    _check_disturbances(scenario)
    _check_faults(scenario)
    _check_discovery(scenario)
    for realisation in realisations:
        model.check_inputs(realisation.schedule, scenario.starts, where="inputs")


def check_realisation(realisation: Realisation) -> None:
    """Check the inputs and the plant's parameters of a run, whose seed need not be one of the scenario's.

    Raises
    ------
    RangeError
        An input leaves the model's range.
    ModelError
        A parameter leaves its own.
    """
    s = realisation.scenario
    s.model.check_inputs(realisation.schedule, s.starts, where=f"inputs of seed {realisation.seed}")
    _check_parameters(realisation)


def _check_plant(scenario: Scenario) -> None:
    """The plant shows the outputs of the model, and what wanders is there and is not the controller's."""
    model, plant = scenario.model, scenario.plant_model
    if plant.names("outputs") != model.names("outputs"):
        raise ScenarioError("plant.cell: its outputs are not those of the model; give a cell with the same outputs")
    inputs = [q.column for q in model.inputs]
    imposed = [inputs[j] for j in scenario.imposed]
    for key in scenario.file.plant.feed_walk:
        if key in inputs and key not in imposed:
            raise ScenarioError(f"plant.feed_walk: {key!r} is the controller's to move; name one without a range")
        if key not in inputs:
            with located("plant.feed_walk"):
                plant.index("parameters", key)


def _check_parameters(realisation: Realisation) -> None:
    plant = realisation.scenario.plant_model
    with located("parameters"):
        for name, _ in realisation.scenario.moving_parameters:
            values = realisation.parameters[:, plant.index("parameters", name)]
            for extreme in (values.min(), values.max()):
                plant.with_parameters({name: float(extreme)})


def _check_closed_loop(scenario: Scenario) -> None:
    file = scenario.file
    columns = [q.column for q in scenario.model.inputs]
    if file.limits is not None:
        for key in (*file.limits.inputs, *file.limits.largest_move):
            if key not in columns:
                raise ScenarioError(f"limits: unknown input {key!r}; {near_match(key, columns)}")
        for key, (low, high) in [("level_m", file.limits.level_m), *file.limits.inputs.items()]:
            if not low < high:
                raise ScenarioError(f"limits: {key} = [{low:g}, {high:g}]; give the lower value first")
    for case in file.cases:
        for name, known in ((case.estimator, file.estimators), (case.controller, file.controllers)):
            if name not in known:
                raise ScenarioError(f"cases: {name!r} is not defined; {near_match(name, known)}")


def _check_disturbances(scenario: Scenario) -> None:
    model = scenario.model
    imposed = [model.inputs[j].column for j in scenario.imposed]
    for key in scenario.file.disturbances:
        if key in (q.column for q in model.inputs):
            if key not in imposed:
                raise ScenarioError(f"disturbances: {key!r} is not one; name an input without a range in 'limits'")
        elif key not in (name for p in model.parameters for name in (p.name, p.symbol)):
            known = (*imposed, *model.names("parameters"))
            raise ScenarioError(f"disturbances: unknown input or parameter {key!r}; {near_match(key, known)}")
        elif model.parameters[model.index("parameters", key)].name in scenario.setup.parameters:
            raise ScenarioError(f"disturbances: {key!r} is adapted, so it can not be measured too; leave one out")


def _check_initial_state(scenario: Scenario) -> None:
    states = {q.column: q for q in (*scenario.plant_model.states, *scenario.model.states)}
    for key, value in scenario.file.initial_state.items():
        if key not in states:
            raise ScenarioError(f"initial_state: unknown state {key!r}; {near_match(key, states)}")
        if not states[key].lower <= value <= states[key].upper:
            low, high = states[key].lower, states[key].upper
            raise ScenarioError(f"initial_state: {key} = {value:g} lies outside [{low:g}, {high:g}]; correct it")


def _check_faults(scenario: Scenario) -> None:
    file = scenario.file
    moved = [q.column for j, q in enumerate(scenario.model.inputs) if j not in scenario.imposed]
    for i, fault in enumerate(file.faults):
        where = f"faults.{i} ({fault.fault})"
        if fault.from_s >= file.duration_s:
            raise ScenarioError(
                f"{where}: from_s = {fault.from_s:g} is not before the end, {file.duration_s:g} s; correct it"
            )
        if isinstance(fault, Stuck):
            if fault.input not in moved:
                raise ScenarioError(f"{where}: {fault.input!r} has no actuator; {near_match(fault.input, moved)}")
        elif not isinstance(fault, ControllerFault):
            if fault.output not in file.measurements:
                hint = near_match(fault.output, file.measurements)
                raise ScenarioError(f"{where}: output {fault.output!r} is not measured; {hint}")
            if isinstance(fault, SlowAnalyser) and fault.output in scenario.dead_times:
                raise ScenarioError(f"{where}: {fault.output!r} has a dead_time_s already; leave one out")


def _check_discovery(scenario: Scenario) -> None:
    file, model, part = scenario.file, scenario.model, scenario.file.discovery
    if part is None:
        return
    for name in part.estimators or ():
        if name not in file.estimators:
            raise ScenarioError(f"discovery.estimators: {name!r} is not defined; {near_match(name, file.estimators)}")
        if file.estimators[name].needs_truth(scenario.path.parent):
            raise ScenarioError(f"discovery.estimators: {name!r} is shown the truth and lacks nothing; leave it out")
    if not scenario.watched:
        raise ScenarioError("discovery: there is no estimator to watch; add one that is not shown the truth")
    for name in part.outputs or ():
        if name not in file.measurements:
            raise ScenarioError(f"discovery.outputs: {name!r} is not measured; {near_match(name, file.measurements)}")
    if not model.sites:
        raise ScenarioError(f"discovery: model {model.name!r} has no sites, so no effect can be found; leave it out")
    if part.window_s < FEWEST * file.sampling_s:
        least = FEWEST * file.sampling_s
        raise ScenarioError(f"discovery.window_s = {part.window_s:g} s holds too few samples; give {least:g} s or more")
    if part.least_record_s > part.record_s:
        raise ScenarioError(
            f"discovery: least_record_s = {part.least_record_s:g} s is longer than record_s = {part.record_s:g} s; "
            "make it shorter"
        )
    if part.least_record_s + part.delay_s > file.duration_s:
        raise ScenarioError(
            f"discovery: a search needs least_record_s + delay_s = {part.least_record_s + part.delay_s:g} s, longer "
            f"than the run, {file.duration_s:g} s; make them shorter"
        )


def _check_times(scenario: Scenario) -> None:
    file = scenario.file
    intervals = file.duration_s / file.sampling_s
    if not 2 <= intervals <= MOST_INTERVALS or abs(intervals - round(intervals)) > 1e-9:
        raise ScenarioError(
            f"duration_s = {file.duration_s:g} must be a whole number (2 to {MOST_INTERVALS:g}) of sampling_s intervals"
        )
    with located("sampling_s"):
        check_interval(scenario.model, file.sampling_s)
    if not 2 <= scenario.initial_rows < round(intervals):
        raise ScenarioError(
            f"initial_estimate.until_s = {file.initial_estimate.until_s:g} s must hold 2 intervals or more and lie "
            f"before the end, {file.duration_s:g} s; correct it"
        )
    if not file.initial_estimate.until_s <= scenario.fits_after < file.duration_s:
        raise ScenarioError(
            f"fits_after_s = {scenario.fits_after:g} must lie between initial_estimate.until_s "
            f"({file.initial_estimate.until_s:g} s) and the end ({file.duration_s:g} s); correct it"
        )
