"""Colours for light and dark paper. A contender has the same colour on every figure and on every page."""

from __future__ import annotations

from collections.abc import Iterable
from zlib import crc32

SLOTS: tuple[tuple[str, str], ...] = (
    ("#0072b2", "#56b0e8"),  # blue
    ("#d55e00", "#ff8f4a"),  # vermilion
    ("#009e73", "#35cfa0"),  # green
    ("#b8558d", "#e79ac6"),  # pink
    ("#c98a00", "#f0b83c"),  # amber
    ("#6a4fb3", "#ab97f2"),  # violet
    ("#8c5a2b", "#cf9f70"),  # brown
    ("#4aa5d8", "#9fd8fa"),  # sky
    ("#7f7f7f", "#a3a3a3"),  # grey
    ("#2b2b2b", "#e0e0e0"),  # nearly the ink
)
"""(light, dark) of each slot, after Okabe and Ito (2008): told apart with every common colour vision."""
GREY, INK = 8, 9
"""Slots that nobody is given by chance: constant parameters, and the oracle."""
NAMED = {
    "truth": ("#000000", "#f2f2f2"),
    "limit": ("#b2182b", "#ff6b75"),
    "plan": ("#8a3ffc", "#be95ff"),
    "band": ("#ededed", "#2c3036"),
    "grid": ("#e3e3e3", "#33383e"),
    "usual": ("#d9d9d9", "#454b52"),
    "state-0": ("#d1495b", "#ff7f8f"),
    "state-1": ("#edae49", "#ffd280"),
    "state-2": ("#30638e", "#7db4e0"),
    "state-3": ("#00798c", "#4cc3d6"),
    "state-4": ("#6c757d", "#c2c9d0"),
    "state-5": ("#7b2d8b", "#cf8fdc"),
}
"""(light, dark) of what is no contender."""
STATES = 6

_COLOURED = ("rpem", "ekf", "mhe", "imm", "pem", "rpem_discovery", "adaptive_imm", "rpem_full")
_KNOWN = {name: slot for slot, name in enumerate(_COLOURED)} | {"fixed": GREY}
ORACLE = "oracle"
"""Estimator that is shown the truth: nearly black, as the truth is black."""
_USUAL_CONTROLLERS = ("schedule", "economic_mpc")


def contender_slots(contenders: Iterable[tuple[str, str]]) -> dict[tuple[str, str], int]:
    """Slot of each contender, (controller, estimator): the same on every page, as far as colours last.

    A shipped estimator has a colour of its own, with `economic_mpc`, in open loop and without a controller (""). Others
    get one by their name; where that one is taken, the next free one, in alphabetical order.

    >>> contender_slots([("economic_mpc", "rpem"), ("economic_mpc", "fixed")])
    {('economic_mpc', 'rpem'): 0, ('economic_mpc', 'fixed'): 8}
    """
    listed = list(dict.fromkeys(contenders))
    slots: dict[tuple[str, str], int] = {}
    for who in sorted(listed, key=lambda c: (not _is_known(c), c)):
        if who[1] == ORACLE:
            slots[who] = INK
            continue
        wanted = _KNOWN[who[1]] if _is_known(who) else crc32(", ".join(who).encode()) % GREY
        taken = {slot for other, slot in slots.items() if other[1] != ORACLE}
        free = [slot for k in range(GREY) if (slot := (wanted + k) % GREY) not in taken]
        slots[who] = wanted if wanted not in taken or not free else free[0]
    return {who: slots[who] for who in listed}


def _is_known(who: tuple[str, str]) -> bool:
    controller, estimator = who
    return estimator in _KNOWN and controller in ("", *_USUAL_CONTROLLERS)


def colour(slot: int, dark: bool = False) -> str:
    """Colour of a slot; they repeat.

    >>> colour(0) == colour(10)
    True
    """
    return SLOTS[slot % len(SLOTS)][dark]


def style_sheet() -> str:
    """Colours as CSS variables (`--slot-0`, `--truth`): light, dark by the system, and either by the page's switch."""
    both = {f"slot-{i}": pair for i, pair in enumerate(SLOTS)} | NAMED
    light, dark = ("".join(f"--{name}:{pair[k]};" for name, pair in both.items()) for k in (0, 1))
    return (
        f":root{{{light}}}\n"
        f"@media screen and (prefers-color-scheme: dark){{:root:not([data-theme=light]){{{dark}}}}}\n"
        f"@media screen{{:root[data-theme=dark]{{{dark}}}}}\n"
    )
