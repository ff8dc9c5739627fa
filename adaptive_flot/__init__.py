"""Froth flotation in Python: simulate the cell, track its parameters, control it, find the physics a model lacks.

The front door, usually imported as ``import adaptive_flot as af``:

=================  ============================================================================================
`run`              Run a scenario with several estimators, controllers and seeds.
`estimate`         Fit a model to a measured record, and replay the record through estimators.
`discover`         Find what physical effect a model lacks, from a measured record.
`simulate`         Simulate a table of inputs.
`import_record`    Bring a historian's export into the shape of a record.
`load_scenario`    Read and check a scenario file.
`read_dataset`     Read and check a measured table for a model.
`Model`            A model: its `Quantity` and `Parameter` tuples, and equations written into a `Scope`.
`Effect`           A term at a site of a model; `KnownEffect` is one that a search may call by name.
=================  ============================================================================================

Everything is imported when it is first used, so that ``import adaptive_flot`` itself loads no other library.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from adaptive_flot.api.estimation import estimate
    from adaptive_flot.api.finding import discover
    from adaptive_flot.api.importing import import_record
    from adaptive_flot.api.runs import run
    from adaptive_flot.api.simulation import simulate
    from adaptive_flot.errors import AdaptiveFlotError
    from adaptive_flot.greybox.data.dataset import read_dataset
    from adaptive_flot.greybox.effects import Effect
    from adaptive_flot.greybox.model import Model
    from adaptive_flot.greybox.quantities import KnownEffect, Parameter, Quantity
    from adaptive_flot.greybox.scope import Scope
    from adaptive_flot.runner.scenario.loading import load_scenario

    __version__: str

__all__ = [
    "AdaptiveFlotError",
    "Effect",
    "KnownEffect",
    "Model",
    "Parameter",
    "Quantity",
    "Scope",
    "__version__",
    "discover",
    "estimate",
    "import_record",
    "load_scenario",
    "read_dataset",
    "run",
    "simulate",
]

_HOMES = {
    "AdaptiveFlotError": "errors",
    "Effect": "greybox.effects",
    "KnownEffect": "greybox.quantities",
    "Model": "greybox.model",
    "Parameter": "greybox.quantities",
    "Quantity": "greybox.quantities",
    "Scope": "greybox.scope",
    "discover": "api.finding",
    "estimate": "api.estimation",
    "import_record": "api.importing",
    "load_scenario": "runner.scenario.loading",
    "read_dataset": "greybox.data.dataset",
    "run": "api.runs",
    "simulate": "api.simulation",
}
"""Module of each name; imported on first use (PEP 562)."""

if not TYPE_CHECKING:  # a type checker would take any name for one of this module

    def __getattr__(name: str) -> object:
        """Import a public name on first use."""
        if name == "__version__":
            from importlib.metadata import version

            value: object = version("adaptive-flot")
        elif name in _HOMES:
            value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Names for completion: those imported already and those that would be."""
    return sorted({*globals(), *__all__})
