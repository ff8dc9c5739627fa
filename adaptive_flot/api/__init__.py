"""The front door for Python: one function a task, each with a result that shows, plots, reports and saves itself.

The package `adaptive_flot` offers the five functions. Nothing is imported here, so that one task does not load the
libraries of another.

Map
---
runs.py         `run`, and its result `Runs`.
estimation.py   `estimate`, and its result `Estimation`.
finding.py      `discover`, and its result `Finding`.
changes.py      The result of `discover` with references or several records, `Change`.
simulation.py   `simulate`, and its result `Simulation`.
importing.py    `import_record`, and its result `ImportedRecord`.
models.py       A model from what the user gave: a `Model`, a name, or the address of a file.
plugins.py      Estimators and controllers from names, classes, and classes with options.
records.py      What a record may be given as, and what it is called.
progress.py     What a terminal shows while a call works.
shown.py        Tables as notebooks show them; the kinds of a plot.
"""
