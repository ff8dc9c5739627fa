"""A signal ends a run also where a compiled library loses what its handler raised, or makes its own error of it."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.cli.conftest import Call, WriteScenario

SCENARIO = ["--estimator", "hit:Hit", "--out", "out"]
LIBRARY = """
import os

from estimators.fixed import Fixed


class Hit(Fixed):
    def update(self, state, sample):
        if sample.time > 40:
            try:
                os.kill(os.getpid(), {number})
            except BaseException:
                {then}
        return super().update(state, sample)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
@pytest.mark.parametrize(
    "then",
    ["pass", "raise SystemError('<built-in function> returned a result with an exception set')"],
    ids=["lost", "another error"],
)
def test_a_run_ends_as_the_signal_asks(
    call: Call, scenario: WriteScenario, tmp_path: Path, number: signal.Signals, then: str
) -> None:
    (tmp_path / "hit.py").write_text(LIBRARY.format(number=int(number), then=then))
    result = call("run", scenario(), *SCENARIO)
    assert result.code == 128 + number
    said = [line for line in result.err.splitlines() if line.startswith("adaptive-flot")]
    assert said == ([] if number == signal.SIGINT else ["adaptive-flot: ended by SIGTERM"])
    assert not (tmp_path / "out").exists()
    assert call("scenarios").code == 0, "the next command knows nothing of it"
