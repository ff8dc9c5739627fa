"""Protects: a cache makes a value once and stays bounded; models share functions where their equations are the same."""

from __future__ import annotations

import copy
import pickle
import threading
from dataclasses import FrozenInstanceError, replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adaptive_flot.discovery.further_sites.places import with_further_sites
from adaptive_flot.greybox import Model, Scope, Stepper
from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.function_cache import FunctionCache
from adaptive_flot.greybox.stepping import stepper
from adaptive_flot.processes.cascaded_tanks import make_model

AT = 0.0, [5.0, 5.0], [3.0]


@given(st.lists(st.integers(0, 9), max_size=60), st.integers(1, 5))
def test_it_makes_what_a_list_of_the_latest_keys_lacks(keys: list[int], most: int) -> None:
    """Against a plain list of the keys by their last use."""
    cache: FunctionCache[int] = FunctionCache(most)
    recent: list[int] = []
    made: list[int] = []

    def make() -> int:
        made.append(key)
        return 10 * key

    for key in keys:
        made.clear()
        assert cache.get(key, make) == 10 * key
        assert bool(made) == (key not in recent)
        recent = [*(k for k in recent if k != key), key][-most:]
        assert len(cache) == len(recent)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(1, 6)), max_size=60), st.integers(1, 12))
def test_it_keeps_the_latest_as_far_as_their_sizes_allow(asked: list[tuple[int, int]], most: int) -> None:
    """Against a plain list; a size that changes counts as it was told last."""
    cache: FunctionCache[int] = FunctionCache(most)
    recent: list[tuple[int, int]] = []
    made: list[int] = []

    def make() -> int:
        made.append(1)
        return 0

    for key, size in asked:
        made.clear()
        cache.get(key, make, size)
        assert bool(made) == all(k != key for k, _ in recent)
        recent = [*((k, s) for k, s in recent if k != key), (key, size)]
        while sum(s for _, s in recent) > most and len(recent) > 1:
            recent.pop(0)
        assert len(cache) == len(recent)


def test_copies_of_a_cache_are_empty() -> None:
    """The values need not pickle."""
    cache: FunctionCache[object] = FunctionCache(3)
    cache.get("key", lambda: lambda: None)
    for other in (pickle.loads(pickle.dumps(cache)), copy.deepcopy(cache)):
        assert len(other) == 0
    assert len(cache) == 1


def test_records_of_every_length_leave_a_bounded_number_of_functions_and_the_same_bits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A record that grows row by row asks for one more function a row; what was dropped is made again.

    So it is without a compiler. A tape is the same for all lengths.
    """
    monkeypatch.setattr(stepper, "LEAST_STEPS", 10**9)
    model, x0 = make_model(), np.array([5.0, 5.0])
    object.__setattr__(model, "_functions", FunctionCache(4))  # its own, and few
    inputs = np.linspace(2.0, 4.0, 20)[:, None]
    whole = Stepper(make_model(), 4.0).simulate(x0, inputs).states
    for rows in (*range(1, 21), *range(1, 21)):
        np.testing.assert_array_equal(Stepper(model, 4.0).simulate(x0, inputs[:rows]).states, whole[:rows])
        assert len(model._functions) <= 4


def rates(model: Model) -> ca.Function:
    """A function derived from a model."""
    t, x, u, p = model.ode.sx_in()
    return ca.Function("rates", [t, x, u, p], [model.ode(t, x, u, p)[0]])


def scaled_rates(model: Model, factor: float) -> ca.Function:
    t, x, u, p = model.ode.sx_in()
    return ca.Function("scaled_rates", [t, x, u, p], [factor * model.ode(t, x, u, p)[0]])


def test_a_derived_function_is_made_once_for_its_builder_and_arguments() -> None:
    model = make_model()
    assert model.derived(scaled_rates, 2.0) is model.derived(scaled_rates, 2.0)
    expected = np.array(model.derived(rates)(*AT, model.parameter_values))
    for factor in (2.0, 3.0):
        values = np.array(model.derived(scaled_rates, factor)(*AT, model.parameter_values))
        np.testing.assert_allclose(values, factor * expected)


def test_models_of_other_parameter_values_share_functions_and_those_with_effects_do_not() -> None:
    """A function of the model before would silently lack the effect."""
    model = make_model()
    name = model.parameters[0].name
    assert model.with_parameters({name: model.parameters[0].value}).derived(rates) is model.derived(rates)
    before = np.array(model.derived(rates)(*AT, model.parameter_values)).ravel()
    extended = model.with_effects([Effect("pump_flow", "constant", "shift", {"amplitude": 1.0})])
    after = np.array(extended.derived(rates)(*AT, extended.parameter_values)).ravel()
    pumped = model.parameter_values[model.index("parameters", "pump_gain")] * 3.0
    np.testing.assert_allclose(after - before, [pumped * np.expm1(1.0), 0.0], atol=1e-12)


def test_models_made_one_by_one_share_functions_where_their_content_is_the_same() -> None:
    model, own = make_model(), rates
    made = model.derived(own)
    assert make_model().derived(own) is made
    assert replace(model, starts_steady=not model.starts_steady).derived(own) is made

    def doubled(m: Scope) -> None:
        model.equations(m)
        for name, rate in m.derivatives.items():
            m.derivatives[name] = 2.0 * rate

    for other in (
        replace(model, equations=doubled),
        replace(model, max_step_s=0.5 * model.max_step_s),
        model.with_effects([Effect("pump_flow", "constant", "shift")]),
        with_further_sites(model),
    ):
        assert other.derived(own) is not made


def test_what_equations_read_from_outside_is_no_reason_to_take_the_functions_of_before() -> None:
    """The same function object, as in a notebook where a constant is given again."""
    size = [1.0]

    def sized(m: Scope) -> None:
        make_model().equations(m)
        for name, rate in m.derivatives.items():
            m.derivatives[name] = size[0] * rate

    found = []
    for size[0] in (1.0, 3.0):
        model = replace(make_model(), equations=sized)
        found.append(np.array(model.derived(rates)(*AT, model.parameter_values)).ravel())
    np.testing.assert_allclose(found[1], 3.0 * found[0])


def test_a_model_may_be_written_with_lists() -> None:
    """They can be no key of what is kept; and effects are added to tuples."""
    model = make_model()
    inputs = [replace(q, usual=[0.0, 1.0]) for q in model.inputs]  # type: ignore[arg-type]
    other = replace(model, states=list(model.states), inputs=inputs, parameters=list(model.parameters))  # type: ignore[arg-type]
    assert isinstance(other.states, tuple)
    extended = other.with_effects([Effect("pump_flow", "constant", "shift")])
    assert len(extended.parameters) == len(model.parameters) + 1


def test_threads_do_not_share_functions_of_models_that_each_makes() -> None:
    """Those with buffers are for one thread at a time."""
    found: list[object] = [make_model().derived(rates)]
    thread = threading.Thread(target=lambda: found.append(make_model().derived(rates)))
    thread.start()
    thread.join()
    assert len(found) == 2 and found[0] is not found[1]


def test_a_model_stays_frozen_and_compares_by_what_it_is() -> None:
    model = make_model()
    model.derived(rates)
    with pytest.raises(FrozenInstanceError):
        model.name = "other"  # type: ignore[misc]
    assert model == make_model()  # what was derived from it is no part of it


def test_a_pickled_model_gives_the_same_bits_and_carries_no_derived_function() -> None:
    model, x0, inputs = make_model(), np.array([5.0, 5.0]), np.full((3, 1), 3.0)
    expected = Stepper(model, 4.0, accurate=True).simulate(x0, inputs).states
    assert len(model._functions) > 0
    other: Model = pickle.loads(pickle.dumps(model))
    assert len(other._functions) == 0
    np.testing.assert_array_equal(Stepper(other, 4.0, accurate=True).simulate(x0, inputs).states, expected)
