"""Many members of one model side by side: each with its own states, inputs and parameters.

Map
---
lane_source.py       C source of a function in lanes: one lane of a vector register a member.
lane_library.py      The machine code, called on blocks of members.
loop_library.py      The same for a function that is too large for lanes: one member after the other.
lanes.py             A function for many members over many rows; by CasADi's `map` where nothing can be compiled.
one_member.py        A single record in one call.
ensemble.py          Simulation of the members of a model, with or without sensitivities.
steady_states.py     Steady states of the members of a model.
"""
