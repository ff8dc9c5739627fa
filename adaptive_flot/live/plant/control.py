"""Who sets the inputs of the test plant. It trusts no client, and watches the link's heartbeat."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.live.safety.modes import Mode

WATCHDOG_INTERVALS = 3
"""Intervals without a new heartbeat of the link after which the plant takes control back."""


@dataclass(frozen=True)
class PanelState:
    """What the next interval needs.

    Attributes
    ----------
    acting
        Value of each moved input that acts, by name, in its unit.
    local
        The operator's set-points; while the link has control they follow what acts, so that nothing moves when it
        loses it.
    remote
        What the link has written for the next interval.
    limits
        The operator's limits (low, high) of each moved input.
    switch
        How far the operator lets the link go.
    heartbeat, silent
        The link's last heartbeat, and intervals since it changed.
    asked, active
        The link asks for control; the link has it.
    refused
        Writes that were refused so far.
    """

    acting: Mapping[str, float]
    local: Mapping[str, float]
    limits: Mapping[str, tuple[float, float]]
    remote: Mapping[str, float] = field(default_factory=dict)
    switch: Mode = Mode.MONITOR
    heartbeat: int = 0
    silent: int = WATCHDOG_INTERVALS
    asked: bool = False
    active: bool = False
    refused: int = 0


class Panel:
    """The operator's panel: limits, mode switch, local set-points, and the hand-over of control.

    Parameters
    ----------
    limits
        Clamps and rate limit of each moved input: those of the plant, which no operator can widen.
    """

    def __init__(self, limits: Mapping[str, WriteLimit]) -> None:
        self.limits = limits

    def start(self, acting: Mapping[str, float]) -> PanelState:
        """The operator has control, at these values."""
        own = {name: (limit.low, limit.high) for name, limit in self.limits.items()}
        return PanelState(dict(acting), dict(acting), own)

    def limit(self, state: PanelState, name: str) -> WriteLimit:
        """Limits of an input now: the plant's, inside the operator's."""
        return self.limits[name].within(*state.limits[name])

    def refusal(self, state: PanelState, name: str, value: float) -> str:
        """Why a set-point of the link is not taken; empty where it is."""
        if not state.active:
            return "the link has no control"
        return self.limit(state, name).refusal(value, state.acting[name])

    def remote(self, state: PanelState, values: Mapping[str, float]) -> tuple[PanelState, str]:
        """The link writes set-points: all are taken, or none and the words say why."""
        for name, value in values.items():
            why = self.refusal(state, name, value)
            if why:
                return replace(state, refused=state.refused + 1), f"{name} = {value:g}: {why}"
        return replace(state, remote={**state.remote, **values}), ""

    def asked(self, state: PanelState, asks: bool) -> PanelState:
        """The link asks for control, or gives it back. It must ask anew after it has lost it."""
        if not asks:
            return replace(state, asked=False, active=False)
        granted = not state.asked and state.switch is Mode.CLOSED and state.silent < WATCHDOG_INTERVALS
        return replace(state, asked=True, active=state.active or granted)

    def beat(self, state: PanelState, heartbeat: int) -> PanelState:
        """The link shows that it is alive."""
        return state if heartbeat == state.heartbeat else replace(state, heartbeat=heartbeat, silent=0)

    def operated(self, state: PanelState, name: str, value: float) -> tuple[PanelState, str]:
        """The operator sets `switch`, `<input>.local`, `<input>.low` or `<input>.high`; words where it is refused."""
        if name == "switch":
            if value not in (Mode.OFF, Mode.MONITOR, Mode.ADVISORY, Mode.CLOSED):
                return state, f"the switch has 0 to 3, not {value:g}"
            switch = Mode(int(value))
            return replace(state, switch=switch, active=state.active and switch is Mode.CLOSED), ""
        moved, _, part = name.rpartition(".")
        own = self.limits[moved]
        if not (math.isfinite(value) and own.low <= value <= own.high):
            return state, f"{name} = {value:g} is outside [{own.low:g}, {own.high:g}]"
        if part == "local":
            return replace(state, local={**state.local, moved: value}), ""
        low, high = state.limits[moved]
        changed = (value, high) if part == "low" else (low, value)
        if changed[0] > changed[1]:
            return state, f"{name} = {value:g} leaves no room between low and high"
        return replace(state, limits={**state.limits, moved: changed}), ""

    def interval(self, state: PanelState) -> PanelState:
        """What acts in the next interval: the link's set-points, or the local ones, approached at the rate limit."""
        silent = state.silent + 1
        lost = state.active and silent > WATCHDOG_INTERVALS
        if state.active and not lost:
            acting = {**state.acting, **state.remote}
            return replace(state, acting=acting, local=dict(acting), remote={}, silent=silent)
        acting = {name: self._approached(state, name) for name in state.acting}
        return replace(state, acting=acting, remote={}, silent=silent, active=False)

    def _approached(self, state: PanelState, name: str) -> float:
        acting, rate = state.acting[name], self.limits[name].rate
        return min(max(state.local[name], acting - rate), acting + rate)
