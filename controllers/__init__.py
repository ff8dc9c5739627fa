"""Controllers: one file each, one contract (`adaptive_flot.protocols.Controller`). Named in scenarios by short name."""
