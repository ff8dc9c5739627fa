"""The step of the cell as JAX code: the same scalar operations, members innermost. JAX itself is not needed here.

As a script, in an environment with JAX: `python jax_step.py step.py case.npz repeats` prints the median processor time
of a record.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

_FORMS = {
    **{"OP_ADD": "{0}+{1}", "OP_SUB": "{0}-{1}", "OP_MUL": "{0}*{1}", "OP_DIV": "{0}/{1}", "OP_NEG": "-{0}"},
    **{"OP_SQ": "{0}*{0}", "OP_TWICE": "2*{0}", "OP_INV": "1/{0}", "OP_SQRT": "jnp.sqrt({0})"},
    **{"OP_EXP": "jnp.exp({0})", "OP_LOG": "jnp.log({0})", "OP_POW": "{0}**{1}", "OP_CONSTPOW": "{0}**{1}"},
}


def source(function: Any) -> str:
    """Python source of `step(x, t, u, p)` from a CasADi function: rows in, a list of rows for each result."""
    import casadi as ca

    names = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
    lines = ["import jax.numpy as jnp", "def step(x, t, u, p):", "    args = [x, [t], u, p]"]
    lines.append(f"    out = [[None] * n for n in {[function.nnz_out(i) for i in range(function.n_out())]}]")
    for k in range(function.n_instructions()):
        op = names[function.instruction_id(k)]
        i, o = function.instruction_input(k), function.instruction_output(k)
        if op == "OP_INPUT":
            lines.append(f"    a{o[0]} = args[{i[0]}][{i[1]}]")
        elif op == "OP_OUTPUT":
            lines.append(f"    out[{o[0]}][{o[1]}] = a{i[0]}")
        elif op == "OP_CONST":
            lines.append(f"    a{o[0]} = {function.instruction_constant(k)!r}")
        else:
            lines.append(f"    a{o[0]} = {_FORMS[op].format(*(f'a{j}' for j in i))}")
    return "\n".join([*lines, "    return out", ""])


def main() -> None:
    """Time records in JAX; one thread, so that processor time is that of one core."""
    import os

    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    space: dict[str, Any] = {}
    with open(sys.argv[1], encoding="utf-8") as stream:
        exec(stream.read(), space)  # what `source` wrote
    case = np.load(sys.argv[2])
    p, members = [jnp.asarray(row) for row in case["p"]], case["x"].shape[1]

    def row(x: Any, u: Any) -> tuple[Any, Any]:
        x_next, y, _ = space["step"](x, 0.0, u, p)
        full = [jnp.broadcast_to(v, (members,)) for v in x_next]
        return jnp.stack(full), jnp.stack([jnp.broadcast_to(v, (members,)) for v in y])

    run = jax.jit(lambda x, u: jax.lax.scan(row, x, u))
    x, u = jnp.asarray(case["x"]), jnp.asarray(case["u"])
    jax.block_until_ready(run(x, u))
    taken = []
    for _ in range(int(sys.argv[3])):
        begin = time.process_time()
        jax.block_until_ready(run(x, u))
        taken.append(time.process_time() - begin)
    print(float(np.median(taken)))


if __name__ == "__main__":
    main()
