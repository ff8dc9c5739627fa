"""The modes of the link, as a state machine of one step a cycle, without input or output.

off       The link reads nothing and writes nothing but its heartbeat.
monitor   It reads and estimates.
advisory  It decides too, for people to see.
closed    Its decisions are written, after the plant has granted control.
shed      It has given control back to the plant's own loop, and waits for a person.

The switch of the operator says how far the link may go. A link that has just started, or has shed, is not armed: it
goes to monitor, and no further until the operator has turned the switch down to monitor and up again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum


class Mode(IntEnum):
    """How far the link goes; the operator's switch has the first four."""

    OFF = 0
    MONITOR = 1
    ADVISORY = 2
    CLOSED = 3
    SHED = 4


@dataclass(frozen=True)
class ModeRules:
    """How patient the link is.

    Attributes
    ----------
    highest
        It never goes further, whatever the switch says.
    shed_after
        Bad cycles in a row after which it sheds.
    handshake_cycles
        Cycles that the plant has to grant control; then the request is withdrawn.
    """

    highest: Mode = Mode.ADVISORY
    shed_after: int = 3
    handshake_cycles: int = 10


@dataclass(frozen=True)
class ModeState:
    """What the next step needs.

    Attributes
    ----------
    mode
        The mode.
    armed
        The operator's switch was seen at monitor or off since the start or the last shedding.
    bad
        Bad cycles in a row.
    waiting
        Cycles since control was asked for; 0 where it is not asked for.
    """

    mode: Mode = Mode.MONITOR
    armed: bool = False
    bad: int = 0
    waiting: int = 0


@dataclass(frozen=True)
class CycleFacts:
    """What a cycle found.

    Attributes
    ----------
    switch
        The operator's switch; None where it can not be read.
    alive
        The plant told a new sample.
    measured
        Every value that a move is computed from is good.
    solved
        There is an estimate and a valid decision.
    in_time
        The cycle before ended before its deadline.
    written
        What the cycle before wrote was taken and read back.
    granted
        The plant says that the link has control.
    """

    switch: Mode | None
    alive: bool
    measured: bool
    solved: bool
    in_time: bool
    written: bool
    granted: bool

    def faults(self) -> tuple[str, ...]:
        """What makes the cycle a bad one, in words."""
        checks = (
            (self.alive, "no new sample from the plant"),
            (self.measured or not self.alive, "a value that a move needs is missing"),
            (self.solved or not (self.alive and self.measured), "no estimate, or no valid decision"),
            (self.in_time, "the cycle before took too long"),
            (self.written, "a write was refused or read back differently"),
            (self.switch is not None or not self.alive, "the operator's switch can not be read"),
        )
        return tuple(words for good, words in checks if not good)


@dataclass(frozen=True)
class Step:
    """What a step of the state machine says.

    Attributes
    ----------
    state
        For the next step.
    may_write
        Decisions of this cycle may be written.
    asks_control
        The link tells the plant that it wants control.
    reason
        Why the mode changed; empty where it did not.
    """

    state: ModeState
    may_write: bool
    asks_control: bool
    reason: str = ""


def step(rules: ModeRules, state: ModeState, facts: CycleFacts) -> Step:
    """One cycle of the state machine.

    Parameters
    ----------
    rules
        How patient the link is.
    state
        What the last step left.
    facts
        What this cycle found.
    """
    faults = facts.faults()
    bad = state.bad + 1 if faults else 0
    armed = state.armed or (facts.switch is not None and facts.switch <= Mode.MONITOR)
    now = replace(state, bad=bad, armed=armed)
    if state.mode is Mode.CLOSED:
        return _closed(rules, now, facts, faults)
    if state.mode is Mode.SHED:
        return _shed(now, facts)
    return _below(rules, now, facts, bool(faults))


def _closed(rules: ModeRules, now: ModeState, facts: CycleFacts, faults: tuple[str, ...]) -> Step:
    if facts.switch is not None and facts.switch < Mode.CLOSED:
        lower = replace(now, mode=min(facts.switch, rules.highest), waiting=0)
        return Step(lower, False, False, "the operator turned the switch down")
    if facts.alive and not facts.granted:
        return _give_up(now, "the plant has taken control back")
    if now.bad >= rules.shed_after:
        return _give_up(now, f"{now.bad} bad cycles in a row: {', '.join(faults)}")
    return Step(now, not faults, True)


def _give_up(now: ModeState, why: str) -> Step:
    return Step(replace(now, mode=Mode.SHED, armed=False, waiting=0), False, False, why)


def _shed(now: ModeState, facts: CycleFacts) -> Step:
    if facts.switch is not None and facts.switch <= Mode.MONITOR:
        return Step(replace(now, mode=facts.switch, waiting=0), False, False, "the operator turned the switch down")
    return Step(replace(now, armed=False), False, False)


def _below(rules: ModeRules, now: ModeState, facts: CycleFacts, faulty: bool) -> Step:
    """Off, monitor and advisory: follow the switch, as far as the link is armed; ask for control in advisory."""
    if facts.switch is None:
        return Step(replace(now, waiting=0), False, False)
    wanted = min(facts.switch, rules.highest, Mode.CLOSED if now.armed else Mode.MONITOR)
    below = min(wanted, Mode.ADVISORY)
    if below != now.mode:
        return Step(replace(now, mode=below, waiting=0), False, False, f"the operator's switch is at {_word(facts)}")
    if wanted < Mode.CLOSED or faulty:
        return Step(replace(now, waiting=0), False, False)
    if now.waiting and facts.granted:
        return Step(replace(now, mode=Mode.CLOSED, waiting=0), True, True, "the plant has granted control")
    if now.waiting >= rules.handshake_cycles:
        refused = replace(now, armed=False, waiting=0)
        return Step(refused, False, False, "the plant has not granted control; turn the switch down and up again")
    return Step(replace(now, waiting=now.waiting + 1), False, True)


def _word(facts: CycleFacts) -> str:
    return "unknown" if facts.switch is None else facts.switch.name.lower()
