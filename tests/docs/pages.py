"""The pages of the documents, and the fences in them."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BENCHMARKS = ROOT / "benchmarks"
PAGES = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")), *sorted(BENCHMARKS.rglob("*.md")))
PROSE = (*PAGES, ROOT / "CHANGELOG.md")


def name_of(page: Path) -> str:
    """Path of a page from the root, as tests call it."""
    return str(page.relative_to(ROOT))


def fences(page: Path, language: str) -> list[str]:
    """Contents of all fences of a language, also those inside a list."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^\1```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [text for _, text in found]
