"""No sequence of events lets the link write what it must not: the mode machine and the limits, event by event."""

import math
from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import given
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.live.safety.modes import CycleFacts, Mode, ModeRules, ModeState, step

GOOD = CycleFacts(Mode.CLOSED, alive=True, measured=True, solved=True, in_time=True, written=True, granted=False)
RULES = ModeRules(Mode.CLOSED)
LEVELS = [Mode.OFF, Mode.MONITOR, Mode.ADVISORY, Mode.CLOSED]


class AnySequence(RuleBasedStateMachine):
    """Every combination of switch, faults and answers of the plant, with restarts between."""

    def __init__(self) -> None:
        super().__init__()
        self.state, self.facts = ModeState(), GOOD
        self.last = step(RULES, ModeState(), replace(GOOD, switch=None))
        self.bad = 0
        self.down_since_loss = False  # the switch was at monitor or below since the start or the last shedding

    @rule(
        switch=st.sampled_from([None, *LEVELS, Mode.CLOSED, Mode.CLOSED]),
        broken=st.sets(st.sampled_from(["alive", "measured", "solved", "in_time", "written"]), max_size=2),
        quiet=st.integers(0, 2),
        granted=st.booleans(),
    )
    def cycle(self, switch: Mode | None, broken: set[str], quiet: int, granted: bool) -> None:
        values = {
            name: quiet > 0 or name not in broken for name in ("alive", "measured", "solved", "in_time", "written")
        }
        self.facts = CycleFacts(switch=switch, granted=granted, **values)
        self.before = self.state
        self.bad = self.bad + 1 if self.facts.faults() else 0
        if switch is not None and switch <= Mode.MONITOR:
            self.down_since_loss = True
        self.last = step(RULES, self.state, self.facts)
        self.state = self.last.state
        if self.state.mode is Mode.SHED and self.before.mode is not Mode.SHED:
            self.down_since_loss = False

    @rule()
    def grant(self) -> None:
        """The usual way up: the switch down, up, and the plant grants."""
        self.cycle(Mode.MONITOR, set(), 1, False)
        for _ in range(2):
            self.cycle(Mode.CLOSED, set(), 1, False)
        self.cycle(Mode.CLOSED, set(), 1, True)

    @rule()
    def restart(self) -> None:
        self.state, self.bad, self.down_since_loss = ModeState(), 0, False
        self.last = step(RULES, ModeState(), replace(GOOD, switch=None, alive=False))

    @invariant()
    def writes_only_when_all_is_well(self) -> None:
        if self.last.may_write:
            assert self.state.mode is Mode.CLOSED
            assert not self.facts.faults()
            assert self.facts.granted
            assert self.facts.switch is Mode.CLOSED
            assert self.down_since_loss

    @invariant()
    def sheds_in_time(self) -> None:
        if self.state.mode is Mode.CLOSED:
            assert self.bad < RULES.shed_after

    @invariant()
    def asks_for_control_only_where_it_may(self) -> None:
        if self.last.asks_control:
            assert self.state.mode in (Mode.ADVISORY, Mode.CLOSED)
            assert self.down_since_loss


def test_no_sequence_of_events_gives_an_unsafe_write() -> None:
    run_state_machine_as_test(AnySequence)


def test_the_usual_way_up_and_down() -> None:
    """Reduction: monitor, advisory, request, grant, closed, and back by the switch, one cycle each."""
    seen, state = [], ModeState()
    events = [
        (Mode.MONITOR, False),
        (Mode.CLOSED, False),
        (Mode.CLOSED, False),
        (Mode.CLOSED, True),
        (Mode.ADVISORY, True),
    ]
    for switch, granted in events:
        made = step(RULES, state, replace(GOOD, switch=switch, granted=granted))
        state = made.state
        seen.append((state.mode, made.may_write, made.asks_control))
    assert seen == [
        (Mode.MONITOR, False, False),
        (Mode.ADVISORY, False, False),
        (Mode.ADVISORY, False, True),
        (Mode.CLOSED, True, True),
        (Mode.ADVISORY, False, False),
    ]


def test_a_link_that_has_just_started_does_not_follow_a_switch_left_at_closed() -> None:
    state = ModeState()
    for _ in range(20):
        made = step(RULES, state, replace(GOOD, granted=True))
        state = made.state
        assert (state.mode, made.may_write, made.asks_control) == (Mode.MONITOR, False, False)


def test_a_request_that_is_not_granted_is_withdrawn() -> None:
    state = step(RULES, ModeState(), replace(GOOD, switch=Mode.MONITOR)).state
    asked = 0
    for _ in range(40):
        made = step(RULES, state, GOOD)
        state, asked = made.state, asked + made.asks_control
    assert asked == RULES.handshake_cycles
    assert state.mode is Mode.MONITOR


@pytest.mark.parametrize("highest", [Mode.MONITOR, Mode.ADVISORY])
def test_the_link_file_has_the_last_word(highest: Mode) -> None:
    state = ModeState()
    for switch in [Mode.MONITOR, *[Mode.CLOSED] * 10]:
        made = step(ModeRules(highest), state, replace(GOOD, switch=switch, granted=True))
        state = made.state
        assert state.mode <= highest
        assert not made.may_write


numbers = st.one_of(st.floats(-10, 10), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1.0, 2.0]))


@given(numbers, numbers, st.floats(-5, 5), st.floats(-5, 5), st.floats(1e-6, 3), numbers, numbers)
def test_what_may_be_written_lies_inside_clamps_and_rate(
    target: float, acting: float, low: float, high: float, rate: float, operator_low: float, operator_high: float
) -> None:
    limit = WriteLimit(low, high, rate).within(operator_low, operator_high)
    value = limit.towards(target, acting)
    if value is None:
        return
    assert low <= value <= high
    assert math.isnan(operator_low) or value >= operator_low
    assert math.isnan(operator_high) or value <= operator_high
    assert abs(value - acting) <= rate * (1 + 1e-9) + 1e-9 * abs(acting)
    assert abs(min(max(target, limit.low), limit.high) - value) <= abs(min(max(target, limit.low), limit.high) - acting)


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_target_inside_the_limits_is_reached(target: float, acting: float) -> None:
    limit = WriteLimit(0.0, 1.0, 0.3)
    for _ in range(5):
        reached = limit.towards(target, acting)
        assert reached is not None
        acting = reached
    assert acting == target
