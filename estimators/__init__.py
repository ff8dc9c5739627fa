"""Estimators: one file each, one contract (`adaptive_flot.protocols.Estimator`). Named in scenarios by short name."""
