"""Scenarios, the closed loop and studies of several runs."""
