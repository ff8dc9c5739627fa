"""Moved to `adaptive_flot.yaml_problems`; this name stays until nothing imports it."""

from adaptive_flot.yaml_problems import first_problem

__all__ = ["first_problem"]
