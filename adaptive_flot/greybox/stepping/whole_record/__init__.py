"""A whole record in one call of machine code, with derivatives.

kernels.py         Slopes, decay rates and outputs of a model with their Jacobians, as lists of scalar operations.
statements.py      C statements of the scalar operations.
tape.py            Such a list as numbers, which one library reads for every model; the same as C.
source.py          The C source of that library: the fast step over states and directions, from row to row.
library.py         Called with the tapes of a model, or with its compiled equations once it has run often.
instruction_sets.py  Vector instructions of this machine, chosen at run time.
tape_recursion.py  A function whose results go to its next call, over all rows, with steps before each; several at once.
"""
