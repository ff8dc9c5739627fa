"""Scoring on verdicts made by hand: nothing but the truth is right, and a command that fails is counted."""

import json
import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from adaptive_flot.errors import DataError
from benchmarks.hidden_effects.score.commands import run_command
from benchmarks.hidden_effects.score.figures import method_command
from benchmarks.hidden_effects.score.outcome import classify, effects_told
from benchmarks.hidden_effects.score.results import removed_share, result_row, results_table
from benchmarks.hidden_effects.score.summary import as_json, confusion, rate
from benchmarks.hidden_effects.score.verdict import SubmittedVerdict, read_verdict

GRADE = "concentrate_grade"
BUBBLE = {"site": "bubble_size", "driver": "air_flow"}
BURST = {"site": "burst_rate", "driver": "air_flow"}
WASH = {"site": "entrainment", "driver": "froth_depth"}
WASH_LEVEL = {"site": "entrainment", "driver": "level"}


def _answer(category: str, *effects: dict[str, Any], **more: Any) -> dict[str, Any]:
    errors = {name: {GRADE: {"fit": e, "report": e}} for name, e in (("base_error", 0.011), ("oracle_error", 0.001))}
    answer = {
        "record": "record_0000", "category": category, "right_verdicts": [], "ordinary": category == "single",
        "effects": [{"accepted": [], **effect} for effect in effects], "tolerated": [], "size": {GRADE: 10.0},
        "loop": "open", "noise": {"kind": "white"}, "note": "", **errors,
    }  # fmt: skip
    return answer | more


SINGLE = _answer("single", BUBBLE)
TWIN = _answer("single", {**WASH, "accepted": [{**WASH_LEVEL, "why": "depth is height minus level"}]})
PAIR = _answer("pair", BUBBLE, WASH)
NONE = _answer("none", right_verdicts=["none"], size={})
DRIFT = _answer("drift", right_verdicts=["none"], tolerated=[{"site": "coalescence", "driver": "time", "why": ""}])
BEYOND = _answer("beyond", right_verdicts=["unnamed", "abstain"], tolerated=[{"site": "gas_slip", "driver": "*"}])
STILL = _answer("unexcited", right_verdicts=["none", "abstain"], tolerated=[BUBBLE], size={GRADE: 0.5})
STILL_SEEN = STILL | {"size": {GRADE: 8.0}}
OTHER = {"site": "settling", "driver": "time"}


def _verdict(kind: str, *names: dict[str, str]) -> SubmittedVerdict:
    return SubmittedVerdict.model_validate({"verdict": kind, "class" if kind == "class" else "effects": list(names)})


@pytest.mark.parametrize(
    ("answer", "verdict", "outcome"),
    [
        (SINGLE, _verdict("named", BUBBLE), "right"),
        (SINGLE, _verdict("named", BURST), "wrong_name"),
        (SINGLE, _verdict("named", {"site": "bubble_size", "driver": "time"}), "wrong_name"),
        (SINGLE, _verdict("named", BUBBLE, BURST), "wrong_name"),
        (SINGLE, _verdict("class", BURST, BUBBLE), "right_class"),
        (SINGLE, _verdict("class", BURST, BUBBLE, OTHER, WASH), "vague"),
        (SINGLE, _verdict("class", BURST, OTHER), "wrong_class"),
        (SINGLE, _verdict("unnamed", BUBBLE), "right_place"),
        (SINGLE, _verdict("unnamed", BURST), "vague"),
        (SINGLE, _verdict("none"), "missed"),
        (SINGLE, _verdict("abstain"), "abstained"),
        (SINGLE, _verdict("named"), "failed"),
        (TWIN, _verdict("named", WASH_LEVEL), "right"),
        (PAIR, _verdict("named", WASH, BUBBLE), "right"),
        (PAIR, _verdict("named", WASH), "part"),
        (PAIR, _verdict("named", WASH, BURST), "wrong_name"),
        (NONE, _verdict("none"), "right"),
        (NONE, _verdict("named", BUBBLE), "false_alarm"),
        (NONE, _verdict("class", BUBBLE, BURST), "false_alarm"),
        (NONE, _verdict("unnamed", BUBBLE), "false_alarm"),
        (NONE, _verdict("insufficient"), "abstained"),
        (DRIFT, _verdict("named", {"site": "coalescence", "driver": "time"}), "tolerated"),
        (DRIFT, _verdict("named", {"site": "coalescence", "driver": "air_flow"}), "false_alarm"),
        (BEYOND, _verdict("unnamed", OTHER), "right"),
        (BEYOND, _verdict("named", OTHER), "wrong_name"),
        (BEYOND, _verdict("named", {"site": "gas_slip", "driver": "time"}), "tolerated"),
        (BEYOND, _verdict("none"), "missed"),
        (STILL, _verdict("none"), "right"),
        (STILL, _verdict("named", BUBBLE), "tolerated"),
        (STILL, _verdict("named", OTHER), "false_alarm"),
        (STILL_SEEN, _verdict("named", OTHER), "wrong_name"),
    ],
)
def test_outcomes(answer: dict[str, Any], verdict: SubmittedVerdict, outcome: str) -> None:
    """Each kind of verdict against each kind of truth."""
    assert classify(answer, verdict) == outcome


@pytest.mark.parametrize(
    ("verdict", "told"),
    [
        (_verdict("named", BUBBLE, WASH), 2),
        (_verdict("named", BUBBLE), 1),
        (_verdict("named", BUBBLE, WASH, OTHER), 0),
        (_verdict("class", BURST, BUBBLE, OTHER, WASH), 2),
        (_verdict("class", BURST, BUBBLE), 1),
        (_verdict("class", BURST, BUBBLE, OTHER, WASH, *({"site": f"s{k}", "driver": "time"} for k in range(3))), 0),
        (_verdict("unnamed", WASH), 1),
        (_verdict("abstain", WASH), 0),
        (_verdict("none"), 0),
    ],
)
def test_how_many_of_two_effects_are_told(verdict: SubmittedVerdict, told: int) -> None:
    """Three names for each effect at most, and none of those said for sure may be wrong."""
    assert effects_told(PAIR, verdict) == told


def test_removed_error_is_measured_against_the_benchmarks_own_base() -> None:
    """Half-way from base to oracle is one half, whatever the verdict says of `before`; silence removes nothing."""
    half = SubmittedVerdict.model_validate({"verdict": "named", "error": {GRADE: {"before": 9.0, "after": 0.006}}})
    assert removed_share(SINGLE, half) == pytest.approx(0.5)
    assert removed_share(SINGLE, _verdict("named", BUBBLE)) == 0.0
    assert removed_share(SINGLE, None) == 0.0
    for undecided in ("abstain", "insufficient"):  # the error of a model that nobody is given
        assert removed_share(SINGLE, half.model_copy(update={"verdict": undecided})) == 0.0
    nothing_to_gain = SINGLE | {"base_error": SINGLE["oracle_error"]}
    assert math.isnan(removed_share(nothing_to_gain, half))


def test_removed_error_is_that_of_the_rows_a_verdict_kept() -> None:
    """Three bins of ten rows, of which the verdict kept the second: base 3 and oracle 1 there."""
    squares = {"rows": [10.0, 10.0, 0.0], "base": [1000.0, 90.0, 0.0], "oracle": [10.0, 10.0, 0.0]}
    answer = SINGLE | {"squares": {GRADE: squares}}
    told = {"verdict": "named", "error": {GRADE: {"after": 2.0}}}
    kept = SubmittedVerdict.model_validate({**told, "report_times_s": [[9.0, 20.0]]})
    assert removed_share(answer, kept) == pytest.approx(0.5)
    whole = SubmittedVerdict.model_validate({**told, "report_times_s": [[1.0, 10.0], [11.0, 30.0]]})
    base = math.sqrt(1090 / 20)
    assert removed_share(answer, whole) == pytest.approx((base - 2) / (base - 1))
    nothing = SubmittedVerdict.model_validate({**told, "report_times_s": [[21.0, 30.0]]})
    assert math.isnan(removed_share(answer, nothing))
    unsaid = SubmittedVerdict.model_validate({"verdict": "named", "error": {GRADE: {"after": 0.006}}})
    assert removed_share(answer, unsaid) == pytest.approx(0.5)


def test_rates_are_binomial_with_exact_intervals() -> None:
    """Clopper-Pearson: none of 60 is up to 1 - 0.025^(1/60) = 5.96 %."""
    r = rate("x", pd.Series([False] * 60))
    assert (r.hits, r.count, r.low) == (0, 60, 0.0)
    assert r.high == pytest.approx(1.0 - 0.025 ** (1.0 / 60.0))


def test_a_command_that_fails_is_counted_and_one_that_refuses_abstains() -> None:
    """A crash is no verdict; exit 2 is an honest refusal; both cost the found rate."""
    ends = ({"status": status, "seconds": 1.0} for status in ("crash", "timeout", "refused"))
    rows = [result_row(SINGLE, "no verdict written", end) for end in ends]
    assert [row["outcome"] for row in rows] == ["failed", "timeout", "abstained"]
    left_behind = [
        result_row(SINGLE, _verdict("named", BUBBLE), {"status": s, "seconds": 1.0}) for s in ("crash", "timeout")
    ]
    assert [row["outcome"] for row in left_behind] == ["failed", "timeout"]  # though it had written a verdict
    table = pd.DataFrame([*rows, result_row(SINGLE, _verdict("named", BUBBLE), {"seconds": 2.0})])
    shares = {r["what"]: r["share"] for r in as_json(table)["rates"]}
    assert shares["truth named or in a class of 3, single ordinary"] == 0.25
    assert shares["failed or out of time, of all"] == 0.5
    assert confusion(table).loc["single"].to_dict() == {"right": 1, "abstained": 1, "failed": 1, "timeout": 1}


@pytest.mark.parametrize("text", ["", "[]", '{"verdict": "maybe"}', '{"verdict": "named", "effects": [{"site": 3}]}'])
def test_what_is_no_verdict_is_one_line(tmp_path: Path, text: str) -> None:
    """A malformed file is a reason, not an exception."""
    file = tmp_path / "v.json"
    file.write_text(text)
    reason = read_verdict(file)
    assert isinstance(reason, str) and "\n" not in reason


SCRIPT = """
printf '%s ' "$1" >> "$3"
case "$1" in
  *1.csv) echo "no luck"; exit 1;;
  *2.csv) exit 2;;
  *3.csv) sleep 60;;
esac
echo '{"verdict": "named", "effects": [{"site": "bubble_size", "driver": "air_flow"}]}' > "$2"
"""


def test_every_record_is_run_once_and_no_failure_stops_the_rest(tmp_path: Path) -> None:
    """A crash, a refusal and a hang cost one record each; a second run has nothing left to do."""
    (tmp_path / "answers").mkdir()
    for k in range(4):
        name = f"record_000{k}"
        (tmp_path / "answers" / f"{name}.json").write_text(json.dumps(SINGLE | {"record": name}))
    (tmp_path / "discover.sh").write_text(SCRIPT)
    log = tmp_path / "log"
    command = f"sh {tmp_path / 'discover.sh'} {{record}} {{json}} {log}"
    for _ in range(2):
        run_command(tmp_path, "mine", command, jobs=2, timeout=6.0)
    assert sorted(Path(name).stem for name in log.read_text().split()) == [f"record_000{k}" for k in range(4)]
    table = results_table(tmp_path, "mine").set_index("record")
    assert list(table["outcome"]) == ["right", "failed", "abstained", "timeout"]
    assert "no luck" in (tmp_path / "runs" / "mine" / "verdicts" / "record_0001.log").read_text()
    with pytest.raises(DataError, match="this label ran"):
        run_command(tmp_path, "mine", command + " --other", jobs=1, timeout=6.0)


def test_an_unknown_rival_gets_a_hint() -> None:
    """A slip in --method is one line."""
    with pytest.raises(DataError, match="did you mean 'oracle'"):
        method_command("orcale")
