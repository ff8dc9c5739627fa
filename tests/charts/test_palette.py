"""One colour a contender, on every page."""

from __future__ import annotations

from itertools import combinations

from adaptive_flot.charts.palette import GREY, NAMED, SLOTS, contender_slots, style_sheet
from adaptive_flot.plugins import BATCH_ESTIMATORS, ESTIMATORS

MANY = [("economic_mpc", e) for e in ("rpem", "ekf", "mhe", "fixed", "oracle")] + [("pi", "fixed"), ("hold", "fixed")]


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2, 1.4.3)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_a_shipped_estimator_has_the_same_colour_on_every_page() -> None:
    everyone = contender_slots(MANY)
    for who in MANY[:4]:
        assert contender_slots([who])[who] == everyone[who]
        assert contender_slots([("", who[1])])["", who[1]] == everyone[who]
    assert everyone["economic_mpc", "fixed"] == GREY


def test_every_shipped_estimator_has_a_colour_of_its_own() -> None:
    shipped = [("", name) for name in (*ESTIMATORS, *BATCH_ESTIMATORS)]
    slots = contender_slots(shipped)
    assert len(set(slots.values())) == len(shipped)
    assert all(contender_slots([who])[who] == slots[who] for who in shipped)


def test_no_two_contenders_of_a_page_share_a_colour_and_order_does_not_matter() -> None:
    slots = contender_slots(MANY)
    apart = {who: slot for who, slot in slots.items() if who[1] != "oracle"}
    assert all(a != b for a, b in combinations(apart.values(), 2))
    assert contender_slots(MANY[::-1]) == slots
    assert len(contender_slots([("", f"mine {k}") for k in range(20)])) == 20  # then they repeat


def test_every_line_is_seen_on_its_paper() -> None:
    """Contrast of 2.7 and more, against white and against the dark paper of the pages."""
    for light, dark in (*SLOTS, NAMED["truth"], NAMED["limit"], NAMED["plan"]):
        assert 1.05 / (luminance(light) + 0.05) > 2.7, light
        assert (luminance(dark) + 0.05) / (luminance("#16191d") + 0.05) > 2.7, dark


def test_the_style_sheet_has_both_kinds_of_paper() -> None:
    sheet = style_sheet()
    assert "prefers-color-scheme: dark" in sheet and "[data-theme=dark]" in sheet
    assert all(sheet.count(f"--slot-{i}:") == 3 for i in range(len(SLOTS)))
