"""A value that says nothing true of the process is a missing measurement."""

import math
from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import given

from adaptive_flot.live.safety.checks import Check, TagHistory, TagRules, check
from adaptive_flot.live.safety.tag_value import Quality, TagValue

RULES = TagRules(low=0.0, high=10.0, stale_after_s=5.0, frozen_after_s=3.0, largest_jump=2.0, bad=(9.99,))


def shown(rules: TagRules, values: list[tuple[float, float]], quality: Quality = Quality.GOOD) -> list[Check]:
    """What each of (value, source time) is found to be when it is told at once."""
    history, found = TagHistory(), []
    for value, time in values:
        history, result = check(rules, history, TagValue(value, quality, time), time)
        found.append(result)
    return found


def test_a_good_value_is_a_measurement_once() -> None:
    history, first = check(RULES, TagHistory(), TagValue(1.0, Quality.GOOD, 7.0), 7.0)
    assert (first, history.believed, history.believed_at) == (Check.OK, 1.0, 7.0)
    assert check(RULES, history, TagValue(1.0, Quality.GOOD, 7.0), 8.0)[1] is Check.OLD
    assert check(RULES, history, TagValue(1.0, Quality.GOOD, 7.0), 12.5)[1] is Check.STALE


@pytest.mark.parametrize(
    ("tag", "found"),
    [
        (None, Check.ABSENT),
        (TagValue(1.0, Quality.BAD, 7.0), Check.BAD),
        (TagValue(math.nan, Quality.GOOD, 7.0), Check.BAD),
        (TagValue(math.inf, Quality.GOOD, 7.0), Check.BAD),
        (TagValue(1.0, Quality.UNCERTAIN, 7.0), Check.UNCERTAIN),
        (TagValue(9.99, Quality.GOOD, 7.0), Check.BAD_CODE),
        (TagValue(10.5, Quality.GOOD, 7.0), Check.OUT_OF_RANGE),
        (TagValue(-0.5, Quality.GOOD, 7.0), Check.OUT_OF_RANGE),
        (TagValue(1.0, Quality.GOOD, 1.0), Check.STALE),
        (TagValue(1.0, Quality.GOOD, 100.0), Check.FUTURE),
        (TagValue(1.0, Quality.GOOD, math.nan), Check.FUTURE),
    ],
)
def test_what_is_no_measurement(tag: TagValue | None, found: Check) -> None:
    history, result = check(RULES, TagHistory(), tag, 7.0)
    assert result is found
    assert math.isnan(history.held(RULES, 7.0))


def test_a_value_from_before_the_last_one_is_not_taken() -> None:
    assert shown(RULES, [(1.0, 5.0), (1.1, 4.0), (1.2, 6.0)]) == [Check.OK, Check.BACKWARD, Check.OK]


def test_a_value_that_repeats_itself_to_the_bit_is_frozen_until_it_moves() -> None:
    found = shown(RULES, [(1.0, float(t)) for t in range(6)] + [(1.001, 6.0)])
    assert found == [Check.OK] * 3 + [Check.FROZEN] * 3 + [Check.OK]


def test_an_outlier_is_left_out_and_a_new_level_is_believed_after_three_values() -> None:
    outlier = shown(RULES, [(1.0, 0.0), (8.0, 1.0), (1.1, 2.0)])
    assert outlier == [Check.OK, Check.JUMP, Check.OK]
    level = shown(RULES, [(1.0, 0.0), (8.0, 1.0), (8.1, 2.0), (8.2, 3.0), (8.1, 4.0)])
    assert level == [Check.OK, Check.JUMP, Check.JUMP, Check.OK, Check.OK]


def test_set_points_may_stand_still() -> None:
    rules = replace(RULES, frozen_after_s=math.inf)
    assert set(shown(rules, [(1.0, float(t)) for t in range(50)])) == {Check.OK}


TAGS = st.builds(
    TagValue,
    st.one_of(st.floats(-1, 11), st.sampled_from([math.nan, 9.99, 1.0])),
    st.sampled_from(Quality),
    st.floats(0, 60),
)


@given(st.lists(st.tuples(TAGS, st.floats(0, 60)), max_size=30))
def test_what_is_believed_was_good_in_range_and_recent(told: list[tuple[TagValue, float]]) -> None:
    """Property: whatever a server tells in whatever order, a believed value passed every check when it came."""
    history = TagHistory()
    for tag, now in told:
        before = history.believed_at
        history, found = check(RULES, history, tag, now)
        if found is Check.OK:
            assert tag.quality is Quality.GOOD and 0 <= tag.value <= 10 and tag.value != 9.99
            assert now - tag.source_time <= RULES.stale_after_s
            assert history.believed_at == tag.source_time > before
        else:
            assert history.believed_at == before
