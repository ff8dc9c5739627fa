"""What is certain among the outputs is told where the record as a whole is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adaptive_flot.discovery.results import Alternative, Discovery, Judgement, OutputChange
from adaptive_flot.discovery.verdict import heed_report as stage
from adaptive_flot.discovery.verdict.outputs import certain_words, settled
from tests.discovery.verdict.states import state_of

NOISE = np.array([0.1, 0.1, 0.1])
CHANGES = (
    OutputChange("level", "m", 1.0, 0.11, 0.1, (0.8, 0.9)),
    OutputChange("grade", "-", 1.0, 0.9, 0.1, (0.0, 0.2)),
    OutputChange("flow", "m3/s", 0.1, 0.1, 0.1, (-0.1, 0.1)),
)


def _judged(draught: Discovery, *names: tuple[tuple[str, str], ...]) -> Judgement:
    assert draught.search is not None
    own = draught.search.alternatives[0]
    found = [Alternative(n, (True,) * len(n), replace(own.fit, bic=float(k)), 0.0, -100.0) for k, n in enumerate(names)]
    return Judgement("abstain", found[0], (), tuple(found[1:]), 10.0)


def test_what_is_no_more_than_the_noise_beside_it_is_not_called_wrong() -> None:
    """From row to row there may be less noise than the fit takes for it, and the table shows that of the fit."""
    changes = (OutputChange("core", "degC", 0.337, 0.0754, 0.088, (0.7, 0.8)),)
    assert settled(changes, np.array([0.04])) == ((), ())
    assert settled(changes, np.array([0.07])) == (("core",), ())


def test_outputs_at_their_noise_are_told_apart_from_those_still_wrong() -> None:
    repaired, wrong = settled(CHANGES, NOISE)
    assert repaired == ("level",) and [c.output for c in wrong] == ["grade"]


def test_noise_that_is_not_known_from_row_to_row_is_that_of_the_fit() -> None:
    assert settled(CHANGES, np.array([0.0, 0.0, 0.0]))[0] == ("level",)


def test_the_sentence_names_the_outputs_and_what_all_near_alternatives_share(draught: Discovery) -> None:
    bubbles, lag, flow = ("bubble_size", "air_flow"), ("grade_sensor", "lag"), ("feed_flow", "time")
    said = certain_words(_judged(draught, (bubbles, lag), (bubbles, flow)), CHANGES, NOISE)
    assert said.startswith("In all that come near: bubble_size by air_flow. ")
    assert "bubble_size by air_flow with grade_sensor by lag brings level down to the noise." in said
    assert said.endswith("Still wrong: grade 1 -> 0.9; look for a further cause there.")


@pytest.mark.parametrize(
    ("sets", "told"),
    [
        (((("gangue", "feed_flow"),), (("sensor", "feed_flow"),)), "All that come near depend on feed flow. "),
        (((("gangue", "time"),), (("sensor", "time"), ("pump", "lag"))), "All that come near change in time. "),
        (((("gangue", "constant"),), (("sensor", "constant"),)), ""),  # that says nothing of when
        (((("gangue", "feed_flow"),), (("sensor", "time"),)), ""),
        (
            ((("gangue", "feed_flow"), ("pump", "time")), (("gangue", "feed_flow"),)),
            "In all that come near: gangue by ",
        ),
    ],
)
def test_the_driver_that_all_share_is_told_where_no_place_is(
    draught: Discovery, sets: tuple[tuple[tuple[str, str], ...], ...], told: str
) -> None:
    """Four parts may have done it, and all of them with the feed flow."""
    said = certain_words(_judged(draught, *sets), CHANGES, NOISE)
    assert said.startswith(told or sets[0][0][0])


def test_what_sets_share_is_not_certain_where_none_of_them_comes_near_the_noise(
    draught: Discovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A valve that leaked was told as sets of three, and "in all that come near: supply air by its temperature"."""
    monkeypatch.setattr(stage, "_many_and_none", lambda *given: True)
    assert draught.problem is not None
    coil, room, pipe = ("coil", "power"), ("room", "lag"), ("pipe", "time")
    judged = replace(_judged(draught, (coil, room), (coil, pipe)), word="class")
    state = state_of(draught, judged)
    left = stage.heed_report(state)
    assert left.judged.word == "abstain" and "none comes near the noise" in left.contradiction
    assert "In all" not in left.certain


def test_nothing_certain_is_no_sentence(draught: Discovery) -> None:
    worse = tuple(replace(c, after=c.before) for c in CHANGES)
    assert certain_words(_judged(draught, (("heat_loss", "time"),)), worse, NOISE) == ""
