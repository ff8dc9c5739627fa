"""Code of the documents runs, from the top of each page, as a reader would run it."""

from __future__ import annotations

import shlex
import shutil
import sys
import warnings
from pathlib import Path
from types import ModuleType

import pytest
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser

from adaptive_flot import cli
from tests.docs.pages import DOCS, PAGES, fences, name_of

FROM_FIRST_TO_LAST = (DOCS / "tutorials" / "own_record.md",)
"""Pages whose commands use what their code wrote."""
WITH_CODE = [page for page in PAGES if fences(page, "python")]


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=name_of)
def test_the_code_of_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order, in one namespace and an empty folder; what follows `>>>` prints what stands below it."""
    shutil.copytree(DOCS / "heated_tank", tmp_path / "docs" / "heated_tank")
    monkeypatch.chdir(tmp_path)
    document = Sybil([PythonCodeBlockParser()]).parse(page)
    module = ModuleType("page")  # classes of the page must be found by name, as those of a script
    monkeypatch.setitem(sys.modules, "page", module)
    document.namespace = vars(module)
    examples = list(document.examples())
    assert examples
    with warnings.catch_warnings(action="error"):
        for example in examples:
            example.evaluate()
    if page in FROM_FIRST_TO_LAST:
        _run_commands(page, monkeypatch)


def _run_commands(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shell lines of a page, in their order, in the folder where its code wrote its files."""
    lines = [line for fence in fences(page, "sh") for line in fence.splitlines()]
    assert lines
    for line in lines:
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert not ended.value.code, line
