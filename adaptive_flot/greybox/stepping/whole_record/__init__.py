"""A whole record in one call of machine code, with derivatives.

kernels.py     Slopes, decay rates and outputs of a model with their Jacobians, as lists of scalar operations.
statements.py  C statements of such a list; its numbers are a table beside the code.
source.py      The C source: the fast step over states and directions, from row to row.
library.py     Compiled, loaded and called.
"""
