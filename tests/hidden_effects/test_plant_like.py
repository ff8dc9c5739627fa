"""Plant-like records: what is wrong on all of them is drawn as it is told, and is no wrong name."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from adaptive_flot.discovery.hypotheses.families import LEAST_MOVE
from benchmarks.hidden_effects.cell.sites import OUTPUTS
from benchmarks.hidden_effects.plant.noise import TYPICAL
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict
from benchmarks.plant_like.background import BURN, EVERY, ROWS, draw_background
from benchmarks.plant_like.draw import draw_experiment, entry_of
from benchmarks.plant_like.score import outcome
from benchmarks.plant_like.sizes import size_words, sizes

WASH = ("entrainment", "air_flow")
TRUTH = (WASH,)


def said(word: str, *names: tuple[str, str]) -> SubmittedVerdict:
    """A verdict with these names, or a class of them."""
    told = [{"site": site, "driver": driver} for site, driver in names]
    return SubmittedVerdict.model_validate({"verdict": word, ("class" if word == "class" else "effects"): told})


def answer(*effects: tuple[str, str]) -> dict[str, Any]:
    return {
        "category": "single" if effects else "none",
        "right_verdicts": [] if effects else ["none", "abstain", "insufficient"],
        "effects": [{"site": s, "driver": d, "accepted": []} for s, d in effects],
        "tolerated": [{"site": "settling", "driver": "constant"}, {"site": "feed_grade", "driver": "time"}],
        "size": {"concentrate_grade": 3.0 if effects else 0.0},
    }


@pytest.mark.parametrize(
    ("truth", "verdict", "expected"),
    [
        ((), said("none"), "right"),
        ((), said("named", ("feed_grade", "time")), "tolerated"),
        ((), said("named", WASH), "false_alarm"),
        ((), said("named", ("feed_grade", "time"), WASH), "false_alarm"),
        (TRUTH, said("named", WASH, ("feed_grade", "time")), "right"),
        (TRUTH, said("named", ("feed_grade", "time")), "tolerated"),
        (TRUTH, said("named", ("burst_rate", "level")), "wrong_name"),
        (
            TRUTH,
            said("class", ("burst_rate", "level"), WASH),
            "right_class",
        ),
        (TRUTH, said("class", ("burst_rate", "level"), ("gas_slip", "level")), "wrong_class"),
        (TRUTH, said("class", ("burst_rate", "level"), ("settling", "constant")), "tolerated"),
        (TRUTH, said("abstain"), "abstained"),
    ],
)
def test_what_is_wrong_everywhere_is_struck_from_a_verdict_first(
    truth: tuple[tuple[str, str], ...], verdict: SubmittedVerdict, expected: str
) -> None:
    assert outcome(answer(*truth), verdict) == expected


def test_noise_has_the_size_and_the_memory_that_the_answer_tells() -> None:
    for seed in range(3):
        noise = draw_background(np.random.default_rng(seed)).noise
        assert noise.details is not None
        e = noise.values["concentrate_grade"][BURN::EVERY] / TYPICAL["concentrate_grade"] / noise.details["scale"]
        core = np.clip(e, -4, 4)
        assert np.std(core) == pytest.approx(1.0, abs=0.12)
        assert np.corrcoef(core[1:], core[:-1])[0, 1] == pytest.approx(noise.details["memory"], abs=0.12)


def test_several_constants_are_off_and_gaps_lie_in_the_record() -> None:
    for seed in range(20):
        background = draw_background(np.random.default_rng(seed))
        sites = [s.site for s in background.constants]
        assert 3 <= len(set(sites)) == len(sites) <= 6
        for outputs, first, length in background.gaps:
            assert 0 < first and first + length <= ROWS // EVERY and set(outputs) <= set(OUTPUTS)


def test_inputs_move_only_between_rows_and_a_third_of_the_records_has_no_effect() -> None:
    """A move inside a sampling interval would be a wrong input, which is another fault."""
    rng = np.random.default_rng(1)
    experiment = draw_experiment(rng, draw_background(rng))
    moves = experiment.moves[BURN:].reshape(-1, EVERY, 3)
    assert np.ptp(moves, axis=1).max() == 0.0
    assert np.ptp(experiment.moves, axis=0).min() > LEAST_MOVE * experiment.moves.min()
    assert [entry_of(1, k) is None for k in range(6)] == [False, False, True] * 2
    assert len({entry_of(1, k) for k in range(60)} - {None}) == 40


def test_the_size_of_a_constant_counts_with_what_is_wrong_on_every_record(tmp_path: Path) -> None:
    """Bubbles half as large, of a cell whose bubbles are 10 % smaller: 0.45 of the model's."""
    effect = {"site": "bubble_size", "driver": "constant", "shape": "level", "amplitude": -0.5}
    logarithm = float(np.log(0.5 * 0.9))
    cases = [("named", logarithm, 0.01), ("named", logarithm + 0.1, 0.01), ("class", logarithm, 0.01)]
    verdicts = tmp_path / "runs" / "discover" / "verdicts"
    verdicts.mkdir(parents=True)
    (tmp_path / "answers").mkdir()
    for k, (word, told, half) in enumerate(cases):
        said = {
            "site": "bubble_size",
            "driver": "constant",
            "coefficients": {"amplitude": told},
            "interval95": {"amplitude": [told - half, told + half]},
        }
        answer = {"effects": [effect], "background": {"bubble_size": -0.1}}
        (tmp_path / "answers" / f"record_{k:04d}.json").write_text(json.dumps(answer))
        (verdicts / f"record_{k:04d}.json").write_text(json.dumps({"verdict": word, "effects": [said]}))
    table = sizes(tmp_path, "discover")
    assert list(table.held) == [True, False]
    np.testing.assert_allclose(table.off, [0.0, np.expm1(0.1)], atol=1e-12)
    assert "off by 5.3% in the middle, 10.5% at most; 1 of 2 intervals" in size_words(table)
    assert size_words(sizes(tmp_path, "another")) == "sizes of named constants: none"
