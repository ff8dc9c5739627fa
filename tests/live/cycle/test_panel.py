"""The plant trusts no link: whatever clients do, what acts stays inside clamps and rate, and a silent link loses it."""

import hypothesis.strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

from adaptive_flot.live.plant.control import WATCHDOG_INTERVALS, Panel, PanelState
from adaptive_flot.live.safety.limits import WriteLimit
from adaptive_flot.live.safety.modes import Mode

LIMIT = WriteLimit(0.0, 10.0, 1.0)
ANY = st.one_of(st.floats(allow_nan=True), st.floats(0, 10), st.floats(4, 6))


class AnyClient(RuleBasedStateMachine):
    """Link and operator write anything at any time."""

    def __init__(self) -> None:
        super().__init__()
        self.panel = Panel({"air": LIMIT})
        self.state: PanelState = self.panel.start({"air": 5.0})
        self.beats = 0
        self.acted = 5.0
        self.was_active = False

    @rule(value=ANY)
    def writes(self, value: float) -> None:
        active = self.state.active
        low, high = self.state.limits["air"]
        self.state, why = self.panel.remote(self.state, {"air": value})
        assert bool(why) or (active and max(0.0, low) <= value <= min(10.0, high))

    @rule(asks=st.booleans())
    def asks(self, asks: bool) -> None:
        self.state = self.panel.asked(self.state, asks)

    @rule()
    def beats_again(self) -> None:
        self.beats += 1
        self.state = self.panel.beat(self.state, self.beats)

    @rule(part=st.sampled_from(["switch", "air.low", "air.high", "air.local"]), value=ANY)
    def operates(self, part: str, value: float) -> None:
        self.state, _ = self.panel.operated(self.state, part, value)

    @rule()
    def lets_the_link_go_far(self) -> None:
        """The usual way to control."""
        self.state, _ = self.panel.operated(self.state, "switch", Mode.CLOSED)
        self.beats_again()
        self.asks(False)
        self.asks(True)
        assert self.state.active

    @rule()
    def interval(self) -> None:
        self.was_active, self.acted = self.state.active, self.state.acting["air"]
        silent = self.state.silent
        self.state = self.panel.interval(self.state)
        assert not (self.state.active and silent >= WATCHDOG_INTERVALS)
        if self.was_active and not self.state.active:
            assert self.state.acting["air"] == self.acted, "no bump when the link loses control"

    @invariant()
    def what_acts_is_inside(self) -> None:
        now = self.state.acting["air"]
        assert 0.0 <= now <= 10.0
        assert abs(now - self.acted) <= 1.0 + 1e-6

    @invariant()
    def control_needs_the_operator(self) -> None:
        assert not self.state.active or self.state.switch is Mode.CLOSED


def test_no_client_can_move_the_plant_further_than_it_may() -> None:
    run_state_machine_as_test(AnyClient)


def test_control_that_was_lost_must_be_asked_for_anew() -> None:
    panel = Panel({"air": LIMIT})
    state = panel.operated(panel.start({"air": 5.0}), "switch", Mode.CLOSED)[0]
    state = panel.asked(panel.beat(state, 1), True)
    assert state.active
    for _ in range(WATCHDOG_INTERVALS + 1):
        state = panel.interval(state)
    assert not state.active
    again = panel.asked(panel.beat(state, 2), True)
    assert not again.active
    assert panel.asked(panel.asked(again, False), True).active
