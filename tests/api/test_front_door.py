"""The front door: light to import, complete, and the same names for people and for type checkers."""

from __future__ import annotations

import subprocess
import sys

import pytest

import adaptive_flot as af


def test_importing_the_package_loads_no_other_library() -> None:
    """A script that needs one name must not wait for Matplotlib, pandas and CasADi."""
    code = (
        "import sys; before = set(sys.modules); import adaptive_flot; "
        "print(*sorted({m.partition('.')[0] for m in set(sys.modules) - before} - set(sys.stdlib_module_names)))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert said == ["adaptive_flot"]


def test_every_public_name_is_there_and_is_what_completion_offers() -> None:
    for name in af.__all__:
        assert getattr(af, name) is not None
        assert name in dir(af)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'simulat'"):
        _ = af.simulat  # type: ignore[attr-defined]


def test_the_names_are_those_of_their_own_modules() -> None:
    """No second class of the same name: what the front door gives passes every `isinstance` inside."""
    from adaptive_flot.greybox import Model, Scope, read_dataset

    assert (af.Model, af.Scope, af.read_dataset) == (Model, Scope, read_dataset)
