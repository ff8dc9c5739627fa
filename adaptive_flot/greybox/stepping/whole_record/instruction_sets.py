"""Vector instructions of this machine, chosen at run time: AVX-512, AVX2 with FMA, or none."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from adaptive_flot.greybox.stepping.compiling.compiled import FLAGS, find_compiler, load_library

_VECTOR = (
    *("-O2", "-ftree-vectorize", "-fopenmp-simd", "-fPIC", "-shared"),
    # None of these changes what NaN and infinity do. A division by x may be a product with 1/x, a product and a sum may
    # be rounded once: a unit in the last place.
    *("-fno-math-errno", "-fno-trapping-math", "-freciprocal-math", "-ffp-contract=fast"),
)


@dataclass(frozen=True)
class InstructionSet:
    """Vector instructions.

    Attributes
    ----------
    name
        Name.
    lanes
        Numbers that a register holds: members that are computed at once.
    flags
        Options of the compiler.
    """

    name: str
    lanes: int
    flags: tuple[str, ...]


SCALAR = InstructionSet("scalar", 1, FLAGS)
"""No vector instructions: one member at a time, and the results of CasADi's own code."""
AVX2 = InstructionSet("AVX2", 4, (*_VECTOR, "-mavx2", "-mfma"))
AVX512 = InstructionSet(
    "AVX-512",
    8,
    (*_VECTOR, *(f"-mavx512{x}" for x in ("f", "dq", "vl", "bw")), "-mfma", "-mprefer-vector-width=512"),
)
BY_LEVEL = (SCALAR, AVX2, AVX512)

_PROBE = """
int level(void) {
#if defined(__x86_64__) && defined(__linux__)
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return 0;
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")
        && __builtin_cpu_supports("avx512bw") ? 2 : 1;
#else
    return 0;
#endif
}
"""


def supported() -> tuple[InstructionSet, ...]:
    """Instruction sets of this machine, the widest first; `SCALAR` is always among them.

    Raises
    ------
    CompileError
        There is no compiler that could use them, or it does not work.
    """
    return BY_LEVEL[_level(find_compiler().identity) :: -1]


@lru_cache(maxsize=8)
def _level(compiler: str) -> int:
    del compiler  # with another one it may be another
    return load_library("instructions", _PROBE, FLAGS, _ask)


def _ask(library: Path) -> int:
    return int(ctypes.CDLL(str(library)).level())
