"""A journey: an estimator of one's own beside a shipped one, run, compared, and the pages read."""

from __future__ import annotations

import json
from pathlib import Path

import yaml

from tests.browser.conftest import Check
from tests.cli.conftest import SHORT, Call
from tests.runner.conftest import edited

OWN = """
from estimators.fixed import Fixed

class Mine(Fixed):
    '''Constant parameters under another name.'''
"""


def test_from_an_estimator_of_ones_own_to_who_fits_best(call: Call, tmp_path: Path, right: Check) -> None:
    """Two results, one scenario: the comparison names the best, pairs the seeds, and says what made each run."""
    (tmp_path / "mine.py").write_text(OWN)
    changes = {**SHORT, "seeds": [1, 2, 3], "estimators": {"rpem": {"use": "rpem"}, "mine": {"use": "mine.py:Mine"}}}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(edited(changes), sort_keys=False))
    done = call("run", "short.yaml", "--out", "both")
    assert done.code == 0, done.err
    compared = call("compare", "both", "--out", "compared", "--json", "c.json")
    assert compared.code == 0, compared.err
    (entry,) = json.loads((tmp_path / "c.json").read_text())["comparisons"]
    assert [c["estimator"] for c in entry["contenders"]] == ["rpem", "mine"]
    page = (tmp_path / "compared" / "comparison.html").read_text()
    for text in ("Paired differences", " of 3</td>", "Figure 1", "commit"):
        assert text in page
    right(tmp_path / "both" / "report.html", tmp_path / "compared" / "comparison.html")
