"""A wrong option of an estimator is a named error that says what to give."""

from __future__ import annotations

from typing import Any

import pytest

from adaptive_flot.contracts import Setup
from adaptive_flot.errors import ModelError, PluginError
from adaptive_flot.greybox.model import Model
from adaptive_flot.plugins import BATCH_ESTIMATORS, ESTIMATORS, construct, load

ADAPTED, GRADE = ("growth_exponent", "coalescence_rate"), ("concentrate_grade",)
WRONG_VALUES: list[tuple[str, dict[str, Any], str]] = [
    ("rpem", {"forgetting": 0.0}, "forgetting"),
    ("rpem", {"forgetting": 1.01}, "forgetting"),
    ("rpem", {"forgetting": float("nan")}, "forgetting"),
    ("rpem", {"gradient": "centrl"}, "did you mean 'central'"),
    ("rpem", {"l0_scale": 0.0}, "l0_scale"),
    ("rpem", {"l0_scale": float("nan")}, "l0_scale"),
    ("rpem", {"forget_to": 0.0}, "forget_to"),
    ("rpem", {"freeze_s": 60.0}, "forget_to"),
    ("rpem_full", {"freeze_s": 0.0}, "freeze_s"),
    ("rpem", {"correct_state": {"leval": 1e-3}}, "did you mean 'level'"),
    ("rpem", {"correct_state": {"level": 0.0}}, "level"),
    ("rpem", {"correct_state": {"level": 1e-3}, "state_noise": 0.0}, "state_noise"),
    ("pem", {"initial_state": "stedy"}, "did you mean 'steady'"),
    ("pem", {"initial_state": "estimated", "free": ["leval"]}, "did you mean 'level'"),
]


@pytest.mark.parametrize(("name", "options", "says"), WRONG_VALUES)
def test_a_value_outside_its_range_is_a_model_error(
    model: Model, name: str, options: dict[str, Any], says: str
) -> None:
    factory = load(name, {**ESTIMATORS, **BATCH_ESTIMATORS}, "estimator")
    with pytest.raises(ModelError, match=says) as caught:
        construct(factory, name, "estimator", Setup(model, 1.0, ADAPTED, GRADE), **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("rpem", {"forgeting": 0.9}),
        ("rpem", {"forgetting": "long"}),
        ("fixed", {"forgetting": 0.9}),
        ("pem", {"steps": 3}),
    ],
)
def test_an_option_it_does_not_take_is_a_one_line_plugin_error(
    model: Model, name: str, options: dict[str, Any]
) -> None:
    factory = load(name, {**ESTIMATORS, **BATCH_ESTIMATORS}, "estimator")
    with pytest.raises(PluginError, match=f"{name!r}.*{next(iter(options))}") as caught:
        construct(factory, name, "estimator", Setup(model, 1.0, ADAPTED, GRADE), **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [*ESTIMATORS, *BATCH_ESTIMATORS])
def test_an_unknown_output_in_the_setup_is_a_model_error(model: Model, name: str) -> None:
    factory = load(name, {**ESTIMATORS, **BATCH_ESTIMATORS}, "estimator")
    with pytest.raises(ModelError, match="did you mean 'recovery'"):
        factory(Setup(model, 1.0, ADAPTED, ("recoverry",)))


def test_an_unknown_parameter_in_the_setup_is_a_model_error(model: Model) -> None:
    factory = load("rpem", ESTIMATORS, "estimator")
    with pytest.raises(ModelError, match="did you mean 'growth_exponent'"):
        factory(Setup(model, 1.0, ("growth_exponnt",), GRADE))
