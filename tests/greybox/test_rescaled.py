"""A model with other constants is the model with constant effects of the same size, and comes back as it was."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.greybox.effects import Effect
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.rescaled import as_it_came, factors_as_effects, factors_of, rescaled
from tests.discovery.heated import heated_tank

FACTOR = st.floats(0.5, 2.0)


def rate(model: Model) -> FloatArray:
    return np.array(model.ode(0.0, [320.0], [1500.0, 10.0], model.parameter_values)[0]).ravel()


@settings(max_examples=15, deadline=None)
@given(loss=FACTOR, heating=FACTOR, there=FACTOR)
def test_factors_are_constant_effects(loss: float, heating: float, there: float) -> None:
    has = Effect("heat_loss", "constant", "shift", mode="factor", coefficients={"amplitude": float(np.log(there))})
    for plain in (heated_tank(), heated_tank().with_effects([has])):
        other = rescaled(plain, {"heat_loss": loss, "heating": heating})
        assert dict(factors_of(other)) == {"heat_loss": loss, "heating": heating}
        written = factors_as_effects(other)
        assert not factors_of(written)
        np.testing.assert_allclose(rate(written), rate(other), rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(rate(as_it_came(other)), rate(plain))


def test_factors_replace_those_before() -> None:
    once = rescaled(heated_tank(), {"heat_loss": 2.0})
    again = rescaled(once, {"heat_loss": 1.0})
    np.testing.assert_allclose(rate(again), rate(heated_tank()))
    assert rate(once)[0] < rate(again)[0]


def test_the_value_at_a_site_has_its_factor() -> None:
    plain, other = heated_tank(), rescaled(heated_tank(), {"heat_loss": 1.5})
    where = [s.name for s in plain.sites].index("heat_loss")
    values = [
        np.array(m.site_values(0.0, [320.0], [1500.0, 10.0], m.parameter_values, [])).ravel()[where]
        for m in (plain, other)
    ]
    assert values[1] == pytest.approx(1.5 * values[0])
