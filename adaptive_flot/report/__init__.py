"""Self-contained HTML reports. Matplotlib and jinja2 are imported here and nowhere else in the package.

Map
---
kit/        What every page is made of: page, parts, album, style, figures.
run/        The report of scenario runs.
compare/    Runs side by side.
sweep/      A study of many runs.
discovery/  What a model lacks.
estimate/   A measured record replayed through estimators.
quality/    An imported record.
draws/      Draws of uncertain constants.
templates/  The page (jinja2), its style and its script. Charts that move are in `adaptive_flot.charts`.

A page gives the answer first: a title that says it, sentences with sizes, a few numbers, one picture. All else is in
folded chapters. The foot says how the page was made.
"""
