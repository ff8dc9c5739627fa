"""The adaptive_flot package of adaptive-flot."""
