"""Fixtures of the engine's tests."""

from __future__ import annotations

import pytest

from adaptive_flot.greybox.function_cache import forget_functions


@pytest.fixture(autouse=True)
def no_functions_of_the_test_before() -> None:
    """A test may take the compiler away, or put other functions in the place of those that models are built from."""
    forget_functions()
