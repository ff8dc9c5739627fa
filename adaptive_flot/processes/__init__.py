"""First-principles models built on the grey-box engine."""
