"""Numbers and lists as text."""

from __future__ import annotations

import math
from collections.abc import Iterable

MINUS = "−"


def number(value: float, form: str = ".2f") -> str:
    """Return a number as text with a true minus sign, none before a zero; a dash where it is not finite.

    >>> number(-1.5), number(float("nan")), number(0.2, "+.1f"), number(-0.004)
    ('−1.50', '–', '+0.2', '0.00')
    """
    if not -float("inf") < value < float("inf"):
        return "–"
    text = f"{value:{form}}"
    zero = not any(digit in text for digit in "123456789")
    return text.lstrip("-") if zero else text.replace("-", MINUS)


def seed_list(seeds: Iterable[int]) -> str:
    """Name seeds briefly.

    >>> seed_list([1, 2, 3]), seed_list([4, 9]), seed_list([1])
    ('3 seeds (1–3)', '2 seeds (4, 9)', 'seed 1')
    """
    listed = list(seeds)
    if len(listed) == 1:
        return f"seed {listed[0]}"
    runs_on = len(listed) > 2 and listed == list(range(listed[0], listed[0] + len(listed)))
    inside = f"{listed[0]}–{listed[-1]}" if runs_on else ", ".join(map(str, listed))
    return f"{len(listed)} seeds ({inside})"


def spaced(name: str) -> str:
    """Return a name as a page shows it.

    >>> spaced("concentrate_grade")
    'concentrate grade'
    """
    return name.replace("_", " ")


def capital(text: str) -> str:
    """Text with a capital first letter."""
    return text[:1].upper() + text[1:]


def joined(words: Iterable[str]) -> str:
    """Words as in a sentence.

    >>> joined(["a"]), joined(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    listed = list(words)
    return " and ".join(filter(None, (", ".join(listed[:-1]), *listed[-1:])))


def p_text(p: float) -> str:
    """Return a p value as text: small ones as a bound, NaN as a dash.

    >>> p_text(0.234), p_text(1e-9), p_text(float("nan"))
    ('= 0.23', '< 0.001', '–')
    """
    if math.isnan(p):
        return "–"
    return "< 0.001" if p < 0.001 else f"= {p:.2g}"
