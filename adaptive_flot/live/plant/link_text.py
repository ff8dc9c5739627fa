"""A link file for the test plant: an example to copy for a real one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from adaptive_flot.live.certificates import LINK, PLANT, TOKENS, identity, password_file, token_file
from adaptive_flot.live.plant.process import measured_outputs, write_limits
from adaptive_flot.live.plant.tags import (
    LINK_ASKS,
    LINK_HEARTBEAT,
    LINK_MODE,
    NAMESPACE,
    PLANT_ACTIVE,
    PLANT_HEARTBEAT,
    SWITCH,
)
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.scenario.scenario import Scenario

HEAD = """\
# A link of `adaptive-flot live` to the test plant of `adaptive-flot serve-plant`.
# tags: what is measured; keys as in the map of `import`, and stale, jump. writes: numbers in the model's unit.
"""
INTERVALS_A_STALE_VALUE = 10
"""Values older than so many intervals of their measurement are stale."""


def link_text(
    scenario: Scenario,
    url: str,
    certificates: Path,
    *,
    highest: str = "closed",
    speed: float = 1.0,
    page: int | None = None,
    case: tuple[str, str] | None = None,
    shadows: Mapping[str, Mapping[str, str]] | None = None,
) -> str:
    """Content of a link file for a scenario's test plant (YAML).

    Parameters
    ----------
    scenario
        The scenario that the plant plays.
    url
        Address of the server.
    certificates
        Folder of `adaptive-flot certificates`.
    highest
        Highest mode: `monitor`, `advisory` or `closed`.
    speed
        How much faster than real time the plant runs.
    page
        Port of the page of the control room; None for no page.
    case
        Controller and estimator; default the scenario's first case with the default estimator, or the first of all.
    shadows
        Estimator and controller of each that runs in shadow, by its name.
    """
    cases = scenario.combinations()
    case = case or next((known for known in cases if known[1] == DEFAULT_ESTIMATOR), cases[0])
    me, plant = identity(certificates, LINK), identity(certificates, PLANT)
    content: dict[str, Any] = {
        "scenario": scenario.name,
        "estimator": case[1],
        "controller": case[0],
        "highest_mode": highest,
        "database": "sqlite:///live.sqlite",
        "server": {
            "url": url,
            "security": "Aes256Sha256RsaPss",
            "certificate": str(me.certificate),
            "key": str(me.key),
            "server_certificate": str(plant.certificate),
            "user": LINK,
            "password_file": str(password_file(certificates, LINK)),
            "namespace": NAMESPACE,
        },
        "tags": _tags(scenario),
        "writes": _writes(scenario),
        "handshake": {
            "plant_heartbeat": PLANT_HEARTBEAT,
            "active": PLANT_ACTIVE,
            "switch": SWITCH,
            "link_heartbeat": LINK_HEARTBEAT,
            "asks": LINK_ASKS,
            "mode": LINK_MODE,
        },
        "cycle": {"speed": speed},
        **({} if page is None else {"page": _page(certificates, page)}),
        **({} if not shadows else {"shadows": {name: dict(part) for name, part in shadows.items()}}),
    }
    return HEAD + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=118)


def _page(certificates: Path, port: int) -> dict[str, Any]:
    files = {f"{name}_token_file": str(token_file(certificates, name)) for name in TOKENS}
    return {"host": "127.0.0.1", "port": port, **files}


def _tags(scenario: Scenario) -> dict[str, Any]:
    model, file, dt = scenario.model, scenario.file, scenario.dt
    tags: dict[str, Any] = {}
    for q in model.inputs:
        tags[q.name] = {"tag": q.name, "unit": q.unit, "stale": f"{INTERVALS_A_STALE_VALUE * dt:g} s"}
    for name in measured_outputs(scenario):
        m, unit = file.measurements[name], model.outputs[model.index("outputs", name)].unit
        age = INTERVALS_A_STALE_VALUE * (m.every_s or dt) + m.dead_time_s
        tags[name] = {"tag": name, "unit": unit, "stale": f"{age:g} s", "frozen": f"{m.frozen_after_s or 5 * dt:g} s"}
    for i in scenario.measured_parameters:
        p = model.parameters[i]
        part = file.disturbances.get(p.name) or file.disturbances.get(p.symbol or "")
        age = INTERVALS_A_STALE_VALUE * ((part.every_s if part else None) or dt) + (part.dead_time_s if part else 0.0)
        tags[f"parameter.{p.name}"] = {"tag": f"parameter.{p.name}", "unit": p.unit, "stale": f"{age:g} s"}
    return tags


def _writes(scenario: Scenario) -> dict[str, Any]:
    return {
        name: {
            "tag": f"{name}.remote",
            "read_back": f"{name}.acting",
            "low": limit.low,
            "high": limit.high,
            "rate": limit.rate,
            "operator_low": f"{name}.low",
            "operator_high": f"{name}.high",
        }
        for name, limit in write_limits(scenario).items()
    }
