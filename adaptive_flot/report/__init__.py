"""Self-contained HTML reports. Matplotlib and jinja2 are imported here and nowhere else in the package.

Map
---
kit/        What every page is made of: page, style, figures, strips.
run/        The report of scenario runs.
compare/    Runs side by side.
discovery/  What a model lacks.
estimate/   A measured record replayed through estimators.
quality/    An imported record.
templates/  The pages (jinja2).
"""
