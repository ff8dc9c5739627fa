"""The site builds, offline and without a warning."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built from a copy of docs/ as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copytree(DOCS, folder / "docs", ignore=shutil.ignore_patterns("generated", "__pycache__"))
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "docs", "html"]
    # a proxy that is not there: whatever asks for the network fails
    offline = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    env = {**os.environ, **offline, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "html"


@pytest.mark.slow
def test_every_page_is_there_loads_nothing_from_the_network_and_draws_its_equations(site: Path) -> None:
    """One test, so that no second worker builds the site again."""
    pages = [p.relative_to(DOCS).with_suffix(".html") for p in DOCS.rglob("*.md")]
    assert [p for p in pages if not (site / p).is_file()] == []
    assert loaded_from_the_network(site) == {}
    assert "<math" in (site / "discovery" / "how_it_decides.html").read_text(encoding="utf-8")


def loaded_from_the_network(site: Path) -> dict[str, list[tuple[str, str]]]:
    """Scripts, styles, pictures and fonts that are no files of the site, by page; links may lead anywhere."""
    script = r'<(?:script|img|iframe|source)[^>]+src="(https?:[^"]+)"'
    style = r'<link[^>]+rel="(?:stylesheet|preload)"[^>]+href="(https?:[^"]+)"'
    loads = re.compile(f"{script}|{style}")
    found = {page.name: loads.findall(page.read_text(encoding="utf-8")) for page in site.rglob("*.html")}
    return {name: urls for name, urls in found.items() if urls}
