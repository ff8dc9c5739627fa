"""Records with the outputs and rows that count, the usual size of each error, and the criterion of a fit.

The criterion is twice the negative log-likelihood of Student's t distribution but for constants::

    sum_j 1 / tau_j  sum_k nu log(1 + (e_kj / s_kj)^2 / nu)

e_kj is the free-run error of output j in row k, s_kj its usual size. Lange, Little & Taylor, *J. Am. Stat. Assoc.* 84
(1989) 881. Errors of a model remember: tau_j rows count as one. So what is known of the constants weighs as it should;
Ribatet, Cooley & Davison, *Statistica Sinica* 22 (2012) 813, on likelihoods that are adjusted in this way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adaptive_flot.discovery.record.robust import least_by_orders
from adaptive_flot.errors import DataError
from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model

BoolArray = NDArray[np.bool_]
TAIL = 5.0
"""Degrees of freedom nu of the errors."""
HUGE = 1e6
"""A free run further off than so many of its usual sizes has left the model."""
ORDERS = (1, 2, 3)
BURN_IN = 10
"""Rows at the start of a record that do not count: its initial state is a guess."""


@dataclass(frozen=True)
class Rows:
    """Records with the outputs that count and the rows that count.

    Attributes
    ----------
    records
        K records of one process.
    columns
        Indices of the measured outputs (m,).
    sizes
        Usual size of the error of each of them in every row, an array (N, m) a record.
    counted
        Rows that count, a mask (N,) a record.
    memory
        Rows of each output that count as one (m,), tau; default 1.
    """

    records: tuple[Dataset, ...]
    columns: tuple[int, ...]
    sizes: tuple[FloatArray, ...]
    counted: tuple[BoolArray, ...]
    memory: FloatArray | float = 1.0

    def with_sizes(self, sizes: Sequence[FloatArray], memory: FloatArray | float = 1.0) -> Rows:
        """The same with other sizes (N, m) and another memory."""
        return replace(self, sizes=tuple(sizes), memory=memory)

    def without(self, left_out: Sequence[BoolArray]) -> Rows:
        """The same without some rows, a mask (N,) a record."""
        kept = tuple(a & ~b for a, b in zip(self.counted, left_out, strict=True))
        return replace(self, counted=kept)

    def behind(self, before: Rows) -> Rows:
        """The rows of other records of the same outputs, and these behind them; the memory is theirs."""
        return replace(
            before,
            records=(*before.records, *self.records),
            sizes=(*before.sizes, *self.sizes),
            counted=(*before.counted, *self.counted),
        )

    def there(self, which: int) -> BoolArray:
        """Values (N, m) of one record that were measured, in rows that count."""
        measured: BoolArray = np.isfinite(self.records[which].outputs[:, list(self.columns)])
        return measured & self.counted[which][:, None]

    def scaled(self, which: int, errors: FloatArray) -> FloatArray:
        """Errors (N, m) of one record over their usual sizes, 0 where none was measured or the row does not count.

        A run that has left the model counts as far off as can be.
        """
        with np.errstate(all="ignore"):
            z = np.clip(np.where(np.isfinite(errors), errors / self.sizes[which], HUGE), -HUGE, HUGE)
        return np.where(self.there(which), z, 0.0)

    def losses(self, errors: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        """Criterion of each row and output, an array (N, m) a record."""
        return tuple(TAIL / self.memory * np.log1p(self.scaled(i, e) ** 2 / TAIL) for i, e in enumerate(errors))

    @property
    def count(self) -> int:
        """Rows that count, of all records."""
        return sum(int(c.sum()) for c in self.counted)


def rows_of(
    records: Sequence[Dataset], columns: Sequence[int], sizes: Sequence[FloatArray], memory: FloatArray | float = 1.0
) -> Rows:
    """All rows of some records but those at their start."""
    counted = []
    for record in records:
        mask = np.ones(len(record), dtype=bool)
        mask[: min(BURN_IN, len(record) // 10)] = False
        counted.append(mask)
    return Rows(tuple(records), tuple(columns), tuple(sizes), tuple(counted), memory)


def measured_columns(model: Model, records: Sequence[Dataset]) -> tuple[int, ...]:
    """Indices of the outputs that every record measures.

    Raises
    ------
    DataError
        There is none.
    """
    common = set.intersection(*(set(record.measured(model)) for record in records))
    if not common:
        names = ", ".join(record.name for record in records)
        raise DataError(f"{names}: no output is measured in all of them; give records with a common output")
    return tuple(j for j, q in enumerate(model.outputs) if q.name in common)


def noise_floor(records: Sequence[Dataset], columns: Sequence[int]) -> FloatArray:
    """Noise of each output from its differences (m,), at least a millionth of its spread: it needs no model.

    The least of those by differences of order n = 1, 2, 3, which leave constants, ramps and parabolas out::

        s_n = 1.4826 median |D^n y| / sqrt(binomial(2 n, n))

    Gasser, Sroka & Jennen-Steinmetz, *Biometrika* 73 (1986) 625.
    """
    noise = np.median([least_by_orders(record.outputs[:, list(columns)], ORDERS) for record in records], axis=0)
    floor: FloatArray = np.maximum(
        np.where(np.isfinite(noise), noise, 0.0), 1e-6 * np.maximum(spread(records, columns), 1e-300)
    )
    return floor


def spread(records: Sequence[Dataset], columns: Sequence[int]) -> FloatArray:
    """Standard deviation of each output over all records (m,)."""
    std: FloatArray = np.nanstd(np.concatenate([r.outputs[:, list(columns)] for r in records]), axis=0)
    return std
