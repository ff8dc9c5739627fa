"""The record as discovery sees it.

Map
---
screening.py          What in a record can not be used, said before anything is fitted.
problem.py            Rows in splits, measured outputs, unknowns that are no effect.
moved_inputs.py       Inputs that act one row later than the record says.
even_steps.py         Outputs that move at even times only: an analyser that is kept in between.
seen.py               What was at every site along a run of a model.
slip_jump.py          A part that stays, and then jumps: its positions, and the bands that give the same ones.
noise.py              What the noise of each output looks like.
noise_level.py        Outputs whose noise becomes several times as large at some time.
robust.py             Spread without outliers, noise without a model, spikes.
effective_samples.py  How many rows of a correlated series count as one sample.
"""
