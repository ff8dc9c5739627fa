"""Self-contained HTML reports. matplotlib and jinja2 are imported here and nowhere else in the package."""
