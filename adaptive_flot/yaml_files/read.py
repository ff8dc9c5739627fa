"""Read a YAML file that somebody wrote: plain values only, each key once, of a size that a person could write.

Every scenario, cell, model and study file comes through here. The loader is PyYAML's safe one with further limits: an
alias is counted as often as it stands, so that a few lines can not grow to gigabytes. The text is taken apart in C
where PyYAML has that, five times as quickly; what is no YAML is read again in Python, whose messages are told.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from adaptive_flot.errors import AdaptiveFlotError

MOST_BYTES = 200_000
"""Largest file; the largest one shipped has 3,000."""
MOST_NODES = 50_000
"""Most keys and values of a file, those behind an alias counted each time."""
DEEPEST = 30
"""Most lists and mappings inside each other."""
LONGEST_KEY = 200
LARGEST_INTEGER = 2**63 - 1
PLAIN = {f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "timestamp", "seq", "map")}
"""Kinds of values that a file may hold; `!!python/object`, `!!binary` and a user's own are refused."""


def read_yaml(path: Path, error: type[AdaptiveFlotError], empty: str) -> dict[str, Any]:
    """Read a file whose outermost level is a mapping.

    Parameters
    ----------
    path
        The file.
    error
        Kind of error to raise, that of the file's purpose.
    empty
        What to say after the path where the file holds no mapping: what is wrong, and what to do.

    Raises
    ------
    AdaptiveFlotError
        Of the kind `error`: unreadable, not YAML, a key given twice, too large, too deep, or a tag that is not plain.
        One line with file, line number and what to do.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise error(f"{path}: larger than {MOST_BYTES} bytes; is this the right file?")
        content = _load(path.read_text(encoding="utf-8-sig"))
    except OSError as problem:
        reason = problem.strerror or str(problem)
        raise error(f"{path}: can not be read ({reason}); check the file and its permissions") from problem
    except UnicodeDecodeError as problem:
        raise error(f"{path}: not a YAML file (no UTF-8 text at byte {problem.start}); correct it") from problem
    except _RefusedError as problem:
        raise error(f"{path}: line {problem.line}: {problem}") from problem
    except yaml.YAMLError as problem:
        raise error(f"{path}: not a YAML file ({_syntax(problem)}); correct it") from problem
    if not isinstance(content, dict):
        raise error(f"{path}: {empty}")
    return content


def line_of(path: Path, place: Sequence[int | str]) -> int | None:
    """Line of a YAML file that holds a key, or the nearest one above it that is there; None for the file as a whole.

    Parameters
    ----------
    path
        A file that `read_yaml` has read.
    place
        Keys and positions from the outermost level inwards, as pydantic names them.
    """
    node = yaml.compose(path.read_text(encoding="utf-8-sig"), Loader=yaml.SafeLoader)
    line = None
    for part in place:
        if isinstance(node, yaml.MappingNode):
            pair = next((pair for pair in node.value if pair[0].value == str(part)), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            pair = node.value[part], node.value[part]
        else:
            pair = None
        if pair is None:
            return line
        line, node = pair[0].start_mark.line + 1, pair[1]
    return line


class _RefusedError(Exception):
    """YAML by its syntax, but nothing that one of our files may hold."""

    def __init__(self, node: yaml.Node, text: str) -> None:
        super().__init__(text)
        self.line = node.start_mark.line + 1


class _Bounded(Composer, SafeConstructor):
    """Safe nodes and values with a bound on depth, checked before Python's own stack ends."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self._depth > DEEPEST:
            mark = self.peek_event().start_mark  # type: ignore[attr-defined]  # of the parser beside it
            raise _RefusedError(yaml.ScalarNode("", "", mark), _too_deep())
        self._depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, TypeError, AttributeError, LookupError) as problem:  # `!!int x`, the date 2024-13-01
            raise _RefusedError(node, f"{_shown(node)} is not what its tag or form says; correct it") from problem


class _Loader(_Bounded, yaml.SafeLoader):
    """The text is taken apart in Python."""


if yaml.__with_libyaml__:
    from yaml.cyaml import CParser  # type: ignore[attr-defined]  # in C, not told by the stubs

    class _CLoader(_Bounded, CParser, Resolver):
        """The text is taken apart in C; the nodes are put together in Python, where their depth is watched."""

        def __init__(self, text: str) -> None:
            CParser.__init__(self, text)
            Composer.__init__(self)
            SafeConstructor.__init__(self)
            Resolver.__init__(self)


def _load(text: str) -> Any:
    if yaml.__with_libyaml__ and "\t" not in text:  # inside a word the two do not agree on a tab
        try:
            return _loaded(_CLoader(text))
        except yaml.YAMLError:  # told by the other loader
            pass
    return _loaded(_Loader(text))


def _loaded(loader: Any) -> Any:
    try:
        root = loader.get_single_node()
        if root is None:
            return None
        _check(root, {})
        return loader.construct_document(root)
    finally:
        loader.dispose()


def _check(node: yaml.Node, known: dict[int, tuple[int, int]]) -> tuple[int, int]:
    """Count and depth of the nodes under a node, aliases expanded; `known` holds those of nodes met before."""
    if id(node) in known:
        count, depth = known[id(node)]
        if not count:
            raise _RefusedError(node, "an alias (*) stands inside its own anchor (&); write the values out")
        return count, depth
    if node.tag not in PLAIN and node.tag != "tag:yaml.org,2002:merge":
        tag = node.tag.replace("tag:yaml.org,2002:", "!!")
        raise _RefusedError(node, f"tag {tag!r} is not allowed; write plain text, numbers, lists and keys")
    known[id(node)] = (0, 0)
    if isinstance(node, yaml.ScalarNode):
        _check_scalar(node)
    if isinstance(node, yaml.MappingNode):
        _check_keys(node)
    parts = [_check(part, known) for part in _parts(node)]
    count, depth = 1 + sum(c for c, _ in parts), 1 + max((d for _, d in parts), default=0)
    if count > MOST_NODES:
        raise _RefusedError(node, f"more than {MOST_NODES} values, aliases (*) written out; make the file smaller")
    if depth > DEEPEST:
        raise _RefusedError(node, _too_deep())
    known[id(node)] = (count, depth)
    return count, depth


def _parts(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []


def _check_keys(node: yaml.MappingNode) -> None:
    first: dict[tuple[str, str], int] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise _RefusedError(key, "a list or mapping can not be a key; write a word")
        if len(key.value) > LONGEST_KEY:
            raise _RefusedError(key, f"a key of {len(key.value)} characters; write a word")
        same = key.tag, key.value
        if same in first:
            raise _RefusedError(
                key, f"key {key.value!r} is given twice (first in line {first[same]}); keep one of them"
            )
        first[same] = key.start_mark.line + 1


def _check_scalar(node: yaml.ScalarNode) -> None:
    if any(unicodedata.category(c) in ("Cc", "Cs") and c not in "\n\r\t" for c in node.value):
        raise _RefusedError(node, f"{_shown(node)} holds a control character; write text that can be printed")
    if node.tag == "tag:yaml.org,2002:int" and len(node.value) > len(str(LARGEST_INTEGER)):
        raise _RefusedError(node, f"a whole number of {len(node.value)} characters; write a smaller one")


def _too_deep() -> str:
    return f"more than {DEEPEST} lists or mappings inside each other; write it flatter"


def _shown(node: yaml.Node) -> str:
    text = repr(node.value) if isinstance(node, yaml.ScalarNode) else "a list or mapping"
    return text if len(text) <= 60 else text[:60] + "..."


def _syntax(problem: yaml.YAMLError) -> str:
    """One line from PyYAML's several."""
    if isinstance(problem, yaml.MarkedYAMLError) and problem.problem_mark is not None:
        return f"line {problem.problem_mark.line + 1}: {problem.problem}"
    return " ".join(str(problem).split())
