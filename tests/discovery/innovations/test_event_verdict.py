"""An event is told only where it reaches every output in which the change shows."""

import pytest

from adaptive_flot.discovery.innovations.event_verdict import _not_touched
from adaptive_flot.discovery.results import OutputChange


@pytest.mark.parametrize(
    ("before", "after", "untouched"),
    [
        (5.0, 4.9, True),  # five times as large as on the reference, and the event does nothing to it
        (5.0, 1.2, False),  # the event brings it down
        (5.0, 3.0, False),  # much is left, but the event is at work there
        (1.5, 1.5, False),  # about as on the reference: nothing has changed there
    ],
)
def test_an_output_far_above_the_reference_that_an_event_leaves_alone(
    before: float, after: float, untouched: bool
) -> None:
    assert _not_touched(OutputChange("flow", "m3/s", before, after, 1.0, (0.0, 0.1))) == untouched
