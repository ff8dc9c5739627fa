"""Machine code of whole records gives the numbers of the plain step, for every form of effect."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox import Effect, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.forms.catalogue import FORMS
from adaptive_flot.greybox.forms.form import CoefficientRole
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.greybox.steady.steady_state import steady_state
from adaptive_flot.greybox.stepping import stepper
from adaptive_flot.greybox.stepping.compiling import compiled
from adaptive_flot.greybox.stepping.compiling.compiled import CompileError, Written, compiler_problem
from adaptive_flot.greybox.stepping.linear_run import linear_run
from adaptive_flot.greybox.stepping.nodes import NodeStepper
from adaptive_flot.greybox.stepping.row_jacobians import row_jacobians
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.greybox.stepping.whole_record import library
from adaptive_flot.greybox.stepping.whole_record import source as source_module
from adaptive_flot.greybox.stepping.whole_record.kernels import kernels
from adaptive_flot.greybox.stepping.whole_record.library import WholeRecord
from adaptive_flot.greybox.stepping.whole_record.source import kernel_source, kernel_source_in_lanes
from adaptive_flot.greybox.stepping.whole_record.tape import tape_of

PROBLEM = compiler_problem()
needs_compiler = pytest.mark.skipif(PROBLEM is not None, reason=f"nothing can be compiled here: {PROBLEM}")
ROWS = 40


@pytest.fixture(autouse=True)
def own_cache(libraries: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(compiled, "cache_folder", lambda: libraries)
    monkeypatch.setattr(stepper, "LEAST_STEPS", 1)
    library._library.cache_clear()
    yield
    compiled._compiler.cache_clear()
    library._library.cache_clear()


def equations(m: Scope) -> None:
    """A slow and a fast state, an algebraic variable, a site in the middle of them."""
    store, fast, level = m.state("store"), m.state("fast"), m.algebraic("level")
    value = m.site("place", m.parameter("gain") * m.input("value") / (1 + 0.1 * store**2), "flow")
    m.residual("level", level + 0.1 * level**3 - store, store)
    m.derivative("store", value - 0.2 * level)
    rate = -m.parameter("rate") * (1 + 0.1 * level**2)
    m.derivative("fast", rate * (fast - value), rate)
    m.output("level", level)
    m.output("fast", m.site("sensor", fast, "sensor"))
    m.signal("value_now", value)


def quantities(*names: str) -> tuple[Quantity, ...]:
    return tuple(Quantity(name, "-", "") for name in names)


SMALL = Model(
    name="small",
    states=quantities("store", "fast"),
    inputs=quantities("value", "drive"),
    parameters=(Parameter("gain", 0.7, "-", ""), Parameter("rate", 1.3, "1/s", "")),
    outputs=quantities("level", "fast"),
    signals=quantities("value_now"),
    algebraic=quantities("level"),
    equations=equations,
    record_code=False,
)
KNOTS = (0.5, 1.0, 1.6)
NEEDED: dict[str, float | tuple[float, ...]] = {"reference": 1.2, "scale": 1.0, "knots": KNOTS, "middle": 1.2}
AWAKE = {
    **{CoefficientRole.ONSET: 12.3, CoefficientRole.THRESHOLD: 1.1, CoefficientRole.LIMIT: 1.0},
    **{CoefficientRole.FLOOR: 0.2, CoefficientRole.POSITION: 0.5, CoefficientRole.BAND: 0.4},
    CoefficientRole.PERIOD: 7.0,
}


def effect_of(name: str) -> Effect:
    """An effect of a form that is awake on the records below."""
    form, kind = FORMS[name], FORMS[name].drivers[0]
    needed = {key: NEEDED[key] for key, default in form.settings.items() if default is None}
    effect = Effect("place", "drive" if kind == "signal" else kind, name, settings=needed)
    values = {c.name: AWAKE.get(c.role, c.default if c.is_shape else 0.2) for c in effect.terms}
    return replace(effect, coefficients=values)


def record(model: Model, rows: int = ROWS) -> tuple[FloatArray, FloatArray]:
    """Start and inputs that move, and rest for a while."""
    rng = np.random.default_rng(3)
    if len(model.inputs) == 2:
        u, x0 = rng.uniform(0.4, 1.8, (rows, 2)), np.full(len(model.states), 0.8)
    else:
        u = rng.uniform([9.05e-4, 1.4e-4, 0.34], [2.17e-3, 2.0e-4, 0.42], (rows, 3))
        x0 = steady_state(model, u[0]).state
    u[: rows // 2] = u[0]
    return x0, u


def alike(found: FloatArray, expected: FloatArray) -> None:
    size = np.max(np.abs(expected), axis=0, keepdims=True, initial=1e-300)
    np.testing.assert_allclose(found / size, expected / size, rtol=0, atol=1e-11)


def compare(model: Model, made: Stepper, quick: Stepper, u: FloatArray, x0: FloatArray) -> None:
    """Run and derivatives of both, by the last parameters, and two directions of the start."""
    wrt = [p.name for p in model.parameters[-5:]]
    p = model.parameter_values
    expected, found = made.simulate(x0, u, p, 5.0), quick.simulate(x0, u, p, 5.0)
    for what in ("time", "states", "outputs", "signals"):
        alike(getattr(found, what), getattr(expected, what))
    gradient = np.zeros((len(x0), len(wrt) + 2))
    gradient[0, -2], gradient[1, -1] = 1.0, 0.3
    expected_s = made.simulate_sensitivities(x0, u, p, wrt, gradient, 5.0)
    found_s = quick.simulate_sensitivities(x0, u, p, wrt, gradient, 5.0)
    for what in ("outputs", "gradient", "last_state", "last_state_gradient"):
        alike(getattr(found_s, what), getattr(expected_s, what))


@needs_compiler
@pytest.mark.parametrize("name", FORMS)
def test_every_form_gives_the_numbers_of_the_plain_step(name: str) -> None:
    extended = SMALL.with_effects([effect_of(name)])
    x0, u = record(extended)
    quick = replace(extended, record_code=True)
    assert isinstance(Stepper(quick, 1.0).record_code(ROWS, None), WholeRecord)
    compare(extended, Stepper(extended, 1.0), Stepper(quick, 1.0), u, x0)


@needs_compiler
@pytest.mark.parametrize("name", FORMS)
def test_a_tape_and_the_compiled_equations_give_the_same_bits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """So nothing depends on when the compiler was thought worth it."""
    extended = replace(SMALL.with_effects([effect_of(name)]), record_code=True)
    (x0, u), p = record(extended), extended.parameter_values
    wrt, gradient = [q.name for q in extended.parameters[-3:]], np.eye(len(x0), 5)
    code = WholeRecord(extended, 1.0, 1, wrt)
    monkeypatch.setattr(library, "is_kept", lambda *_: False)
    by_tape = code(x0, u, p, 5.0, gradient)
    assert code._compiled is None
    monkeypatch.setattr(library, "WORTH_COMPILING", 0)
    again = code(x0, u, p, 5.0, gradient)
    assert code._compiled is not None and {"rates", "rates_held", "ends", "near", "far"} <= set(code._compiled)
    for what in ("states", "outputs", "signals", "gradients", "last_gradient"):
        np.testing.assert_array_equal(getattr(again, what), getattr(by_tape, what))


@needs_compiler
def test_a_model_is_compiled_once_it_has_run_often_and_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    x0, u = record(SMALL)
    p = SMALL.parameter_values
    code = WholeRecord(replace(SMALL, name="often"), 0.9, 1, None)
    monkeypatch.setattr(library, "WORTH_COMPILING", 2 * ROWS)
    kept = iter([False, True])
    monkeypatch.setattr(library, "is_kept", lambda *_: next(kept))
    code(x0, u, p)
    assert code._compiled is None
    code(x0, u, p)
    assert code._compiled
    later = WholeRecord(replace(SMALL, name="later"), 0.9, 1, None)
    later(x0, u[:1], p)
    assert later._compiled == code._compiled, "what is kept is used from the first run on"


@needs_compiler
def test_the_cell_gives_the_numbers_of_the_plain_step(model: Model) -> None:
    x0, u = record(model)
    compare(model, Stepper(replace(model, record_code=False), 1.0), Stepper(model, 1.0), u, x0)


@needs_compiler
@settings(max_examples=8, deadline=None)
@given(substeps=st.integers(1, 12), dt=st.floats(0.2, 1.0), seed=st.integers(0, 2**16))
def test_steps_of_any_length_and_number(substeps: int, dt: float, seed: int) -> None:
    """Fixed intervals of several steps, and intervals that each say how long they are."""
    x0, u = record(SMALL)
    quick = replace(SMALL, record_code=True)
    length = dt * substeps
    several = Stepper(SMALL, length, substeps=substeps), Stepper(quick, length, substeps=substeps)
    compare(SMALL, *several, u, x0)
    lengths = np.random.default_rng(seed).uniform(0.1, 3.0, ROWS)
    compare(SMALL, NodeStepper(SMALL), NodeStepper(quick), np.column_stack([u, lengths]), x0)


@needs_compiler
def test_parameters_may_change_from_row_to_row() -> None:
    x0, u = record(SMALL)
    p = np.tile(SMALL.parameter_values, (ROWS, 1))
    p[:, SMALL.indices("parameters", ["gain"])] *= np.linspace(1.0, 1.2, ROWS)[:, None]
    expected = Stepper(SMALL, 1.0).simulate(x0, u, p)
    alike(Stepper(replace(SMALL, record_code=True), 1.0).simulate(x0, u, p).outputs, expected.outputs)


@needs_compiler
@pytest.mark.parametrize("wrt", [["gain"], ["gain", "gain"]])
def test_the_jacobians_of_each_row(wrt: list[str]) -> None:
    """A parameter that is fitted already is asked for a second time where its site is a candidate again."""
    x0, u = record(SMALL)
    p, times = SMALL.parameter_values, np.arange(float(ROWS))
    plain, quick = Stepper(SMALL, 1.0), Stepper(replace(SMALL, record_code=True), 1.0)
    states = np.vstack([x0, plain.simulate(x0, u, p).states[:-1]])
    expected = row_jacobians(plain, states, times, u, p, wrt)
    for one, other in zip(row_jacobians(quick, states, times, u, p, wrt), expected, strict=True):
        alike(one, other)


@needs_compiler
@settings(max_examples=20, deadline=None)
@given(n=st.integers(1, 6), nx=st.integers(1, 4), r=st.integers(1, 5), seed=st.integers(0, 2**16))
def test_a_linearised_run_is_the_same_both_ways(n: int, nx: int, r: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    jacobians = tuple(rng.normal(size=(n, a, b)) for a, b in ((nx, nx), (nx, 3), (2, nx), (2, 3)))
    A, G, C, H = jacobians
    source = rng.integers(0, 3, int(rng.integers(0, r + 1)))
    given_start, acting = rng.normal(size=(nx, r)), rng.normal(size=(n, len(source)))
    plain = linear_run((A, G, C, H), given_start, source, acting)
    np.testing.assert_allclose(
        linear_run((A, G, C, H), given_start, source, acting, as_machine_code=True), plain, rtol=1e-9, atol=1e-9
    )


def test_knots_are_numbers_beside_the_code() -> None:
    """A search over many records compiles each kind of effect once."""

    def source(reference: float) -> tuple[Written, list[float]]:
        effect = Effect("place", "drive", "power", settings={"reference": reference})
        made = kernels(SMALL.with_effects([effect]), ("gain",), True)
        tapes = {name: tape_of(getattr(made, name), (2, 3)) for name in ("rates", "ends")}
        return kernel_source(tapes), [float(v) for tape in tapes.values() for v in tape.memory]

    (one, numbers), (other, others) = source(1.5), source(1.7)
    assert (one.key, one.write()) == (other.key, other.write())
    assert numbers != others


def test_the_key_of_a_source_tells_it_from_others() -> None:
    """A library is taken by the key of its source alone: of two sources with one key, one would run for the other."""
    sources = []
    for form, set_to in (("power", {"reference": 1.5}), ("linear", {"reference": 1.5}), ("shift", {})):
        effect = Effect("place", "constant" if form == "shift" else "drive", form, settings=set_to)
        made = kernels(SMALL.with_effects([effect]), ("gain",), True)
        for held in ((), (2, 3)):
            tapes = {name: tape_of(getattr(made, name), held) for name in ("rates", "ends")}
            sources += [kernel_source(tapes), *(kernel_source_in_lanes("step", tapes["ends"], n) for n in (4, 8))]
    assert len({s.key for s in sources}) == len({s.write() for s in sources}) == len(sources)


@needs_compiler
def test_a_run_that_leaves_the_model_is_nan_to_its_end() -> None:
    x0, u = record(SMALL)
    u[20] = np.nan
    run = Stepper(replace(SMALL, record_code=True), 1.0).simulate(x0, u, SMALL.parameter_values)
    assert np.isfinite(run.outputs[:20]).all()
    assert np.isnan(run.states[20:]).any(axis=1).all()


def test_without_a_compiler_the_plain_step_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise CompileError("no C compiler found")

    monkeypatch.setattr("adaptive_flot.greybox.stepping.whole_record.library.load_library", refuse)
    x0, u = record(SMALL)
    fresh = replace(SMALL, record_code=True, name="without")
    run = Stepper(fresh, 1.0).simulate(x0, u, SMALL.parameter_values)
    np.testing.assert_array_equal(run.outputs, Stepper(SMALL, 1.0).simulate(x0, u, SMALL.parameter_values).outputs)


def test_a_model_of_very_many_operations_is_left_to_the_plain_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("adaptive_flot.greybox.stepping.whole_record.library.MOST_OPERATIONS", 10)
    quick = Stepper(replace(SMALL, record_code=True, name="large"), 1.0)
    assert quick.record_code(ROWS, None) is None


def test_a_short_run_is_not_worth_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepper, "LEAST_STEPS", ROWS + 1)
    quick = Stepper(replace(SMALL, record_code=True), 1.0)
    assert quick.record_code(ROWS, None) is None


@needs_compiler
def test_what_rests_with_the_inputs_is_worked_out_once_and_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a tape on which no argument is held; inputs that rest, move, and rest again."""
    held = library._HELD
    assert len(tape_of(kernels(SMALL, ("gain",), False).rates, held["rates"]).held) > 1
    monkeypatch.setattr(library, "is_kept", lambda *_: False)
    (x0, u), p, gradient = record(SMALL), SMALL.parameter_values, np.eye(2, 3)
    u = np.column_stack([np.vstack([u, u[-1:], u[:3]]), np.linspace(0.2, 2.0, ROWS + 4)])
    runs = []
    for kept in (held, dict.fromkeys(held, ())):
        monkeypatch.setattr(library, "_HELD", kept)
        runs.append(WholeRecord(replace(SMALL, record_code=True), None, 1, ["gain"])(x0, u, p, 5.0, gradient))
    for what in ("states", "outputs", "signals", "gradients", "last_gradient"):
        np.testing.assert_array_equal(getattr(runs[0], what), getattr(runs[1], what))


def test_a_program_that_was_installed_without_its_source_has_its_version_in_the_key(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_source(module: object) -> str:
        raise OSError("could not get source code")

    monkeypatch.setattr("inspect.getsource", no_source)
    monkeypatch.setattr(source_module, "_writer", source_module._writer.__wrapped__)
    made = kernels(SMALL, ("gain",), True)
    tapes = {"rates": tape_of(made.rates, (2, 3))}
    assert hashlib.sha256(version("adaptive-flot").encode()).hexdigest() in kernel_source(tapes).key
    assert kernel_source(tapes).write().startswith("#include")
