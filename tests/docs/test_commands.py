"""What the documents name exists: commands with their options, scenarios, benchmarks, make targets, files, links."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import typer

from adaptive_flot.cli import app
from adaptive_flot.plugins import ESTIMATORS
from tests.docs.pages import PAGES, ROOT, fences, name_of

CLI: Any = typer.main.get_command(app)  # a group of commands, as typer makes it
ASIDE = frozenset({"pem", "my_method"})
"""The batch method, and the name that a reader's own estimator gets."""
IN_LINE = r"`((?:adaptive-flot|python -m|make) [^`]+)`"


def commands(page: Path) -> list[str]:
    """Shell lines of a page, those of `sh` fences and those in a line, without comments."""
    text = page.read_text(encoding="utf-8")
    fenced = [line for fence in fences(page, "sh") for line in fence.splitlines()]
    in_line = [
        " ".join(found.split()) for found in re.findall(IN_LINE, re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    ]
    return [line.split("#")[0].strip() for line in (*fenced, *in_line) if line.split("#")[0].strip()]


def options_of(name: str) -> set[str]:
    return {option for p in CLI.commands[name].params for option in (*p.opts, *p.secondary_opts)}


def problem(line: str) -> str:
    """What of a shell line does not exist; empty when all does."""
    words = shlex.split(re.sub(r"\$\(.*?\)", "", line))
    if words[0] == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        return "" if words[1] in targets else f"no make target {words[1]!r}"
    if words[:2] == ["python", "-m"]:
        found = words[2] == "pytest" or (ROOT / (words[2].replace(".", "/") + ".py")).is_file() or find_spec(words[2])
        return "" if found else f"no module {words[2]!r}"
    if len(words) == 1 or words[1].startswith("-"):
        return ""
    if words[1] not in CLI.commands:
        return f"no command {words[1]!r}"
    unknown = [w for w in words[2:] if w.startswith("--") and w.split("=")[0] not in options_of(words[1])]
    if unknown:
        return f"no option {unknown[0]!r} of {words[1]!r}"
    named = [b for a, b in pairwise(words) if a == "--estimator"]
    strangers = [n for n in named if ":" not in n and n not in {*ESTIMATORS, *ASIDE}]
    return f"no estimator {strangers[0]!r}" if strangers else ""


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=name_of)
def test_every_command_of_a_page_exists(page: Path) -> None:
    assert [f"{line}: {p}" for line in commands(page) if (p := problem(line))] == []


@pytest.mark.parametrize("name", sorted(CLI.commands))
def test_a_page_names_every_option_of_a_command(name: str) -> None:
    """Of a switch one of its two names will do."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    spelled = [(*p.opts, *p.secondary_opts) for p in CLI.commands[name].params if p.opts[0].startswith("-")]
    assert [s[0] for s in spelled if not any(re.search(rf"{o}(?![\w-])", text) for o in s)] == []


@pytest.mark.parametrize(
    "line",
    [
        "adaptive-flot rn x",
        "adaptive-flot run x --no-such",
        "adaptive-flot run x --estimator nobody",
        "make nothing",
        "python -m benchmarks.nothing",
    ],
)
def test_a_command_that_does_not_exist_is_seen(line: str) -> None:
    assert problem(line)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    """Paths with a folder and an ending, in code spans and in links; a reader's own (`my_...`) left out."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    spans = re.findall(r"`([\w./-]+/[\w.-]+\.(?:py|md|yaml|csv|toml))`", text)
    links = [link.split("#")[0] for link in re.findall(r"\]\((?!https?:|#)([^)]+)\)", text)]
    folders = (
        ROOT,
        ROOT / "adaptive_flot",
        ROOT / "adaptive_flot" / "discovery",
        ROOT / "tests" / "estimators",
        page.parent,
    )
    missing = [s for s in spans if "my_" not in s and not any((f / s).exists() for f in folders)]
    missing += [link for link in links if not (page.parent / link).exists()]
    assert missing == []
