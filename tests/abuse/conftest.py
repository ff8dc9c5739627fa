"""Fixtures of the command line and of studies, for inputs that are wrong in every way."""

from tests.cli.conftest import call, plant, scenario, table
from tests.studies.conftest import write_study

__all__ = ["call", "plant", "scenario", "table", "write_study"]
