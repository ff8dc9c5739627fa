"""A run that has an estimated course is not said to come from the inputs alone."""

from __future__ import annotations

import re
from pathlib import Path

from adaptive_flot.discovery.discover import discover
from adaptive_flot.report.discovery.page import write_discovery_report
from tests.discovery.background.test_background import record_in_a_room, tank_in_a_room
from tests.discovery.heated import heated_tank, tank_record


def test_the_first_caption_tells_the_course(tmp_path: Path) -> None:
    wanders = discover(tank_in_a_room(), record_in_a_room(1.0, exponent=0.6))
    at_rest = discover(heated_tank(), tank_record(rows=300))
    for name, found, expected in (
        ("wanders", wanders, "the estimated course of room"),
        ("at rest", at_rest, "from the inputs alone"),
    ):
        page = tmp_path / f"{name}.html"
        write_discovery_report(found, "tank", page, command="discover tank.csv", read=[])
        text = re.sub(r"\s+", " ", page.read_text(encoding="utf-8"))
        assert expected in text
        assert ("from the inputs alone" in text) == (found is at_rest)
