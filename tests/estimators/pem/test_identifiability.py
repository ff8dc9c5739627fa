"""The verdict on a covariance, from covariances whose answer is plain."""

from __future__ import annotations

import numpy as np
import pytest

from adaptive_flot.contracts.batch import Identifiability


@pytest.mark.parametrize(
    ("std", "word"),
    [
        (0.01, "identified"),
        (0.1, "identified"),
        (0.11, "weak"),
        (0.49, "weak"),
        (0.5, "not identified"),
        (9, "not identified"),
    ],
)
def test_words_follow_the_relative_standard_deviation(std: float, word: str) -> None:
    judged = Identifiability.judge(["a"], np.array([[std**2]]), [False])
    ((label, relative, judgement),) = judged.parameters
    assert (label, judgement) == ("a", word) and relative == pytest.approx(std)
    assert judged.pairs == ()
    assert ("every fitted parameter is identified" in judged.verdict) == (word == "identified")


@pytest.mark.parametrize(("correlation", "count"), [(0.94, 0), (0.96, 1), (-0.96, 1), (0.0, 0)])
def test_a_pair_is_reported_from_a_correlation_of_095_with_its_sign(correlation: float, count: int) -> None:
    covariance = 1e-4 * np.array([[1.0, 2 * correlation], [2 * correlation, 4.0]])
    judged = Identifiability.judge(["a", "b"], covariance, [False, False])
    assert len(judged.pairs) == count
    assert (f"(correlation {correlation:+.3f})" in judged.verdict) == bool(count)


def test_the_verdict_names_each_kind_once() -> None:
    judged = Identifiability.judge(["a", "b", "c", "d"], np.diag([1.0, 0.04, 1e-6, 1e-6]), [False, False, True, False])
    assert judged.verdict.split("; ") == [
        "the record does not identify a",
        "b only to within 20%",
        "c ends on a bound: the model wants a value it may not have",
    ]
