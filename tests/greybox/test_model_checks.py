"""A model that names something wrongly is refused when it is made: in silence it would be searched as another model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from adaptive_flot.errors import ModelError
from adaptive_flot.greybox import Effect, KnownEffect, Model, Parameter, Quantity, Scope


def box(site: tuple[str, str] = ("process", "factor"), role: str = "estimated", **changes: Any) -> Model:
    """One warm box; `site` is role and mode of its only site."""

    def equations(m: Scope) -> None:
        warmth = m.state("warmth")
        loss = m.site("loss", m.parameter("k") * warmth, *site)  # type: ignore[arg-type]
        m.derivative("warmth", m.input("power") - loss)
        m.output("shown", warmth)

    own: dict[str, Any] = {
        "name": "box",
        "states": (Quantity("warmth", "K", ""),),
        "inputs": (Quantity("power", "W", ""),),
        "parameters": (Parameter("k", 1.0, "1/s", "guess", role=role),),  # type: ignore[arg-type]
        "outputs": (Quantity("shown", "K", ""),),
        "equations": equations,
    }
    return Model(**{**own, **changes})


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"site": ("sensr", "factor")}, "'sensr'; did you mean 'sensor'"),
        ({"site": ("sensor", "ofset")}, "'ofset'; did you mean 'offset'"),
        ({"role": "estimate"}, "did you mean 'estimated'"),
        ({"initial_guess": {"warmht": 1.0}}, "did you mean 'warmth'"),
        ({"drivers": ("powr",)}, "did you mean 'power'"),
        ({"late_drivers": ("power",)}, "late_drivers"),
        ({"edges": ("warmth",)}, "known: shown"),
        ({"known_effects": (KnownEffect("los", "power", "x"),)}, "did you mean 'loss'"),
        ({"known_effects": (KnownEffect("loss", "powr", "x"),)}, "did you mean 'power'"),
        ({"max_step_s": 0.0}, "max_step_s"),
        ({"states": (Quantity("warmth", "K", "", scale=0.0),)}, "scale"),
        ({"parameters": (Parameter("k", 1.0, "1/s", "guess", lower=2.0),)}, "outside its range"),
        ({"states": (Quantity("warmth", "K", "", 373.0, 273.0),)}, "'warmth' has lower = 373 above upper = 273"),
        ({"parameters": (Parameter("k", 1.0, "1/s", "guess", lower=2.0, upper=0.0),)}, "exchange them"),
        ({"states": Quantity("warmth", "K", "")}, "states is no tuple of Quantity"),
        ({"outputs": ("shown",)}, "outputs is no tuple of Quantity"),
    ],
)
def test_what_a_model_has_not_is_one_line_with_the_nearest(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ModelError) as error:
        box(**changes)
    assert says in str(error.value) and "'box'" in str(error.value) and "\n" not in str(error.value)


def test_known_effects_of_time_and_constants_name_no_quantity_of_the_model() -> None:
    words = ("time", "constant", "lag", "own_value")
    assert box(known_effects=tuple(KnownEffect("loss", word, "x") for word in words)).known_effects


def test_the_range_of_a_coefficient_may_be_narrowed_beyond_its_value() -> None:
    """A search does so with the time constant of a lag in a record of a few rows: its start is put inside later."""
    model = box().with_effects([Effect("loss", "time", "step", {"amplitude": 0.1, "onset": 30.0})])
    narrowed = [replace(p, upper=6.0) if p.name.endswith("onset") else p for p in model.parameters]
    assert replace(model, parameters=tuple(narrowed)).parameters[-1].upper == 6.0
