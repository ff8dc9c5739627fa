"""YAML files that nobody should write: each gives one line of error with the file, never a traceback or a hang."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from adaptive_flot.errors import AdaptiveFlotError
from adaptive_flot.processes.flotation import read_cell
from adaptive_flot.processes.model_file import load_model_file
from adaptive_flot.resources import cell_file
from adaptive_flot.runner.scenario.loading import load_scenario, shipped_scenarios
from adaptive_flot.studies.study_file import load_study, shipped_studies
from adaptive_flot.yaml_files import read as yaml_files
from adaptive_flot.yaml_files.read import DEEPEST, MOST_BYTES

READERS: dict[str, Callable[[Path], object]] = {
    "scenario": load_scenario,
    "cell": read_cell,
    "model": load_model_file,
    "study": load_study,
}
MODEL = "model: flotation\nparameters:\n  n: {value: 1.02, unit: '-', source: a record}\neffects: []\n"
VALID = {
    "scenario": shipped_scenarios()["paper_scenario_1"].read_text(),
    "cell": cell_file().read_text(),
    "model": MODEL,
    "study": next(iter(shipped_studies().values())).read_text(),
}
BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)

CASES = {
    "key twice": ("description: a\nseeds: [1]\ndescription: b\n", "line 3: key 'description' is given twice"),
    "key twice in one line": ("a: {b: 1, b: 1}\n", "line 1: key 'b' is given twice"),
    "key twice, once quoted": ("a: 1\n'a': 2\n", "line 2: key 'a' is given twice"),
    "alias bomb": (BOMB, "aliases (*) written out; make the file smaller"),
    "alias in its own anchor": ("a: &a [1, *a]\n", "an alias (*) stands inside its own anchor"),
    "alias of nothing": ("a: *b\n", "line 1: found undefined alias"),
    "deep lists": ("a: " + "[" * 5000 + "]" * 5000, "inside each other; write it flatter"),
    "deep mappings": ("".join(f"{' ' * i}a:\n" for i in range(400)), "inside each other; write it flatter"),
    "deep by aliases": (
        "a0: &a0 [1]\n" + "".join(f"a{i + 1}: &a{i + 1} [*a{i}]\n" for i in range(DEEPEST + 5)),
        "inside each other",
    ),
    "object of Python": ("a: !!python/object/apply:os.system ['true']\n", "tag '!!python/object/apply:os.system'"),
    "name of Python": ("a: !!python/name:os.system\n", "is not allowed; write plain text"),
    "tag of one's own": ("a: !mine 3\n", "tag '!mine' is not allowed"),
    "binary": ("a: !!binary aGVsbG8=\n", "tag '!!binary' is not allowed"),
    "set": ("a: !!set {b}\n", "tag '!!set' is not allowed"),
    "a word tagged as integer": ("a: !!int word\n", "line 1: 'word' is not what its tag or form says"),
    "a mapping tagged as text": ("a: !!str {b: 1}\n", "expected a scalar node"),
    "a word tagged as time": ("a: !!timestamp noon\n", "'noon' is not what its tag or form says"),
    "a day that is not there": ("a: 2024-13-45\n", "'2024-13-45' is not what its tag or form says"),
    "integer of 10,000 digits": (f"a: {'9' * 10_000}\n", "a whole number of 10000 characters"),
    "list as key": ("? [a, b]\n: 1\n", "a list or mapping can not be a key"),
    "very long key": (f"? {'a' * 5000}\n: 1\n", "a key of 5000 characters"),
    "NUL in a name": ('"a\\0b": 1\n', "holds a control character"),
    "terminal escape in a name": ('"\\e[31mred": 1\n', "holds a control character"),
    "half of a surrogate pair": ('a: "\\ud800"\n', "holds a control character"),
    "two documents": ("a: 1\n---\nb: 2\n", "line 2: but found another document"),
    "tab as indent": ("a:\n\tb: 1\n", "not a YAML file (line 2"),
    "too large": ("a: 1 #" + "x" * MOST_BYTES, f"larger than {MOST_BYTES} bytes"),
}


def refusal(read: Callable[[Path], object], file: Path) -> str:
    """The message of a refusal; checks that it is one line of bounded length that names the file."""
    with pytest.raises(AdaptiveFlotError) as caught:
        read(file)
    message = str(caught.value)
    assert str(file) in message
    assert message.isprintable() and len(message) < 2000, message
    return message


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize("case", CASES)
def test_abuse_is_refused_in_one_line_by_every_reader(tmp_path: Path, kind: str, case: str) -> None:
    content, part = CASES[case]
    file = tmp_path / "abuse.yaml"
    file.write_text(content, encoding="utf-8")
    assert part in refusal(READERS[kind], file)


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize(
    ("error", "part"), [(PermissionError(13, "Permission denied"), "Permission denied"), (OSError(5, "I/O"), "I/O")]
)
def test_file_that_can_not_be_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, error: OSError, part: str
) -> None:
    """Simulated, because an administrator may read every file."""
    file = tmp_path / "locked.yaml"
    file.write_text(VALID[kind])

    def refuse(*_: object, **__: object) -> str:
        raise error

    monkeypatch.setattr(Path, "read_text", refuse)
    assert f"can not be read ({part})" in refusal(READERS[kind], file)


@pytest.mark.parametrize("kind", READERS)
def test_link_to_nothing_and_folder_are_no_file(tmp_path: Path, kind: str) -> None:
    link = tmp_path / "link.yaml"
    link.symlink_to(tmp_path / "nowhere.yaml")
    folder = tmp_path / "folder.yaml"
    folder.mkdir()
    for path in (link, folder):
        refusal(READERS[kind], path)


def test_anchors_and_merges_within_bounds_are_read(tmp_path: Path) -> None:
    """Honest use of YAML's own means: an anchor used twice, a merge whose key is overridden, a byte order mark."""
    file = tmp_path / "m.yaml"
    entry = "{value: 1.02, unit: '-', source: here}"
    file.write_text(
        f"\ufeffmodel: flotation\nparameters:\n  n: &n {entry}\n  C: {{<<: *n, value: 3.0}}\n", encoding="utf-8"
    )
    read = load_model_file(file)
    assert (read.parameters["n"].value, read.parameters["C"].value) == (1.02, 3.0)
    assert read.parameters["C"].source == "here"


# -- fuzz --------------------------------------------------------------------------------------------------------------

ODD: list[Any] = [
    None, True, 0, -1, 1e300, -1e300, 1e-300, 2**62, float("inf"), float("-inf"), float("nan"), "", "x", "[bold]x[/i]",
    "<script>", "$\\frac", "../..", [], {}, [[]], [None], {"a": 1}, ["x", "x"], [1e300, -1e300], "1e400", "\u202e",
]  # fmt: skip
SNIPPETS = ["&a ", "*a ", "!!int ", "!x ", "[", "]", "{", "}", ": ", "- ", "\n", "\n\n  ", "|", ">", "'", '"', "#", "%",
            "---\n", "<<: ", "\t", "\x00", "\u2028", "? ", "9" * 30, ".inf", "2024-02-30", "0o9", "1:99"]  # fmt: skip


def places(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to every value inside nested lists and mappings."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [p for key, value in items for p in ((*path, key), *places(value, (*path, key)))]


def mutate(content: dict[str, Any], path: tuple[Any, ...], value: object) -> dict[str, Any]:
    """A copy with one value replaced; `...` deletes it."""
    changed = copy.deepcopy(content)
    entry: Any = changed
    for key in path[:-1]:
        entry = entry[key]
    if value is ...:
        del entry[path[-1]]
    else:
        entry[path[-1]] = value
    return changed


def read_or_one_line(read: Callable[[Path], object], file: Path) -> None:
    """Either it is read, or the refusal is one line with the file's name."""
    try:
        read(file)
    except AdaptiveFlotError as error:
        message = str(error)
        assert str(file) in message
        assert len(message.splitlines()) == 1 and len(message) < 2000, message


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=40)
@given(data=st.data())
def test_a_value_replaced_by_an_odd_one(
    tmp_path_factory: pytest.TempPathFactory, kind: str, data: st.DataObject
) -> None:
    """One entry of a valid file deleted or replaced by another type, an extreme or markup."""
    content = yaml.safe_load(VALID[kind])
    path = data.draw(st.sampled_from(places(content)))
    changed = mutate(content, path, data.draw(st.sampled_from([..., *ODD])))
    file = tmp_path_factory.getbasetemp() / f"odd_{kind}.yaml"
    file.write_text(yaml.safe_dump(changed), encoding="utf-8")
    read_or_one_line(READERS[kind], file)


def spoilt(kind: str, data: st.DataObject) -> bytes:
    """Bytes of a valid file flipped, lines doubled or dropped, the file cut, pieces of YAML's syntax inserted."""
    text = VALID[kind]
    at = data.draw(st.integers(0, len(text) - 1))
    how = data.draw(st.sampled_from(["cut", "flip", "insert", "double", "drop"]))
    lines = text.splitlines(keepends=True)
    line = data.draw(st.integers(0, len(lines) - 1))
    return {
        "cut": lambda: text[:at].encode(),
        "flip": lambda: text.encode()[:at] + bytes([data.draw(st.integers(0, 255))]) + text.encode()[at + 1 :],
        "insert": lambda: (text[:at] + data.draw(st.sampled_from(SNIPPETS)) + text[at:]).encode(),
        "double": lambda: "".join([*lines[: line + 1], *lines[line:]]).encode(),
        "drop": lambda: "".join([*lines[:line], *lines[line + 1 :]]).encode(),
    }[how]()


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=60)
@given(data=st.data())
def test_text_cut_overwritten_or_with_syntax_thrown_in(
    tmp_path_factory: pytest.TempPathFactory, kind: str, data: st.DataObject
) -> None:
    """Bytes of a valid file flipped, lines doubled or dropped, the file cut, pieces of YAML's syntax inserted."""
    raw = spoilt(kind, data)
    file = tmp_path_factory.getbasetemp() / f"text_{kind}.yaml"
    file.write_bytes(raw)
    read_or_one_line(READERS[kind], file)


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="this PyYAML is without libyaml")
@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=60)
@given(data=st.data())
def test_a_text_taken_apart_in_c_is_what_it_is_in_python(kind: str, data: st.DataObject) -> None:
    """The same value or the same refusal; the text of PyYAML's own messages is that of Python in both cases."""
    text = spoilt(kind, data).decode("utf-8", "replace")

    def outcome(load: Callable[[str], object]) -> object:
        try:
            return repr(load(text))
        except Exception as refusal:
            return type(refusal).__name__, str(refusal)

    assert outcome(yaml_files._load) == outcome(lambda t: yaml_files._loaded(yaml_files._Loader(t)))
