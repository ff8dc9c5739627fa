"""The sentences of a Markdown page: what a reader reads, without code, tables, comments and directives."""

from __future__ import annotations

import re

MOST_WORDS = 30

_FENCE = re.compile(r"^(`{3,}|:{3,})")
_BLOCK_START = re.compile(r"^\s*(?:[-*+]|\d+\.|:)\s+")
_SENTENCE_END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(\[*`]*[A-Z0-9])")
_ABBREVIATIONS = re.compile(r"\b(e\.g|i\.e|al|Eq|Fig|vol|pp|ch)\.")


def paragraphs(page: str) -> list[str]:
    """Paragraphs, list items and definitions of a page as one line each."""
    page = re.sub(r"<!--.*?-->", "", page, flags=re.DOTALL)
    page = re.sub(r"^\$\$.*?^\$\$.*?$", "", page, flags=re.DOTALL | re.MULTILINE)
    lines, fenced = [], ""
    for line in page.splitlines():
        fence = _FENCE.match(line.strip())
        if fenced:
            fenced = "" if line.strip() == fenced else fenced
        elif fence and fence[1].startswith("`"):
            fenced = fence[1]
        elif fence or line.lstrip().startswith(("|", "#", "![", ":alt:", ":class", ":link", ":gutter", ":columns")):
            lines.append("")
        else:
            lines.append("\n" + _BLOCK_START.sub("", line) if _BLOCK_START.match(line) else line.strip())
    return [" ".join(part.split()) for part in re.split(r"\n\s*\n|\n(?=\n)", "\n".join(lines)) if part.strip()]


def sentences(page: str) -> list[str]:
    """Sentences of a page; inline code and a link count as the words that are shown, code as one."""
    found = []
    for text in paragraphs(page):
        text = re.sub(r"`[^`]*`", "Code", text)
        text = re.sub(r"\$[^$]*\$", "Formula", text)
        text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
        found += _SENTENCE_END.split(_ABBREVIATIONS.sub(r"\1", text))
    return found


def words(sentence: str) -> int:
    """Number of words and numbers of a sentence."""
    return len(re.findall(r"[^\s]*\w[^\s]*", sentence))


def too_long(page: str) -> list[str]:
    """Sentences of more than `MOST_WORDS` words, each with its count."""
    return [f"{n} words: {s}" for s in sentences(page) if (n := words(s)) > MOST_WORDS]
