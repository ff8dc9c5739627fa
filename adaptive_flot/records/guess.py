"""Which tag measures which quantity of a model, and in what unit: by name, unit and size of the values.

A guess is made only where one reading is clearly best. Else the user is asked, see `UnclearError`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from adaptive_flot.errors import DataError, located, near_match
from adaptive_flot.greybox.data.wrong_unit import other_units, units_that_fit
from adaptive_flot.greybox.model import Model
from adaptive_flot.greybox.quantities import Quantity
from adaptive_flot.records.reading.export import Export, Signal
from adaptive_flot.records.reading.raw import UnclearError, map_line
from adaptive_flot.records.tag_map import TagKeys, TagMap
from adaptive_flot.records.units import convert, fits, is_unit, read_unit

WORDS: Mapping[str, tuple[str, ...]] = {
    "air": ("air", "luft", "aire", "gas", "blower"),
    "feed": ("feed", "fd", "fresh", "aufgabe", "alimentacion", "slurry"),
    "flow": ("flow", "flux", "rate", "menge", "durchfluss", "flujo", "caudal"),
    "level": ("level", "lvl", "height", "niveau", "nivel", "pegel", "fuellstand"),
    "setpoint": ("setpoint", "sp", "set", "spt", "sollwert", "target", "consigna"),
    "grade": ("grade", "assay", "gehalt", "ley", "cu", "analysis"),
    "recovery": ("recovery", "rec", "ausbringen", "recuperacion"),
    "tails": ("tails", "tail", "tailing", "tailings", "berge", "relave", "relaves"),
    "concentrate": ("concentrate", "conc", "con", "konzentrat", "concentrado"),
    "voltage": ("voltage", "volt", "volts"),
}
"""Words of plants for words of models."""
LOOP_LETTERS = {"f": "flow", "l": "level", "a": "grade", "q": "grade", "t": "temperature", "p": "pressure"} | {
    "d": "density",
    "s": "speed",
    "j": "power",
}
"""First letter of a loop's name (ISA-5.1): FIC, LT, AI."""
CONTRARY = {"sp": "setpoint", "setpoint": "setpoint", "spt": "setpoint"}
"""Words of a tag that only suit a quantity whose name has the other one."""
SPECIFIC = ("air", "feed", "tails", "concentrate", "recovery")
"""Words that say where in a plant a tag is: one of another place speaks against it."""
PROCESS_VALUE = ("pv", "act", "actual", "ist", "meas", "measured")
NAMED = 0.45
"""Least share of a quantity's words that the name of an output's tag must have."""
CLEAR = 0.2
"""Score by which the best reading must lead."""
IMPOSSIBLE = -1e3


@dataclass(frozen=True)
class Candidate:
    """A tag for a quantity: how well it suits, all in all and by its name alone."""

    score: float
    named: float


def guess_tags(export: Export, model: Model, known: TagMap, *, outputs: bool = True) -> TagMap:
    """Complete the tags and units of a map.

    Parameters
    ----------
    export
        The export.
    model
        The model: its inputs are needed.
    known
        What is known; it is kept.
    outputs
        Whether to look for outputs too.

    Raises
    ------
    UnclearError
        Two tags, or two units, are equally good.
    DataError
        A tag of the map is not in the export, or no tag suits an input.
    """
    _check_names(known, model)
    for name, keys in known.quantities.items():
        if keys.tag not in export.signals:
            raise DataError(f"{export.file}: {name}: no tag {keys.tag!r}; {near_match(keys.tag, export.signals)}")
    for group in (model.inputs, model.outputs if outputs else ()):  # an output never takes a tag that an input needs
        wanted = [q for q in group if not known.names(q.name)]
        used = {keys.tag for keys in known.quantities.values()}
        signals = [s for tag, s in export.signals.items() if tag not in used and np.isfinite(s.values).mean() > 0.2]
        for q, signal in _assigned(wanted, signals, model, export):
            known = known.with_keys(q.name, {"tag": signal.tag})
    for q in (*model.inputs, *model.outputs):
        own = known.quantities.get(q.name)
        if own is not None and own.unit is None:
            known = known.with_keys(q.name, {"unit": _one_unit(q, own, export)})
    return known


def _check_names(known: TagMap, model: Model) -> None:
    """Names are those of the model, and a constant is one of its inputs."""
    parameters = {label for p in model.parameters for label in (p.name, p.symbol)}
    for name in (*known.quantities, *known.constants):
        if name in parameters:
            raise DataError(
                f"{name}: a parameter of model '{model.name}', and no quantity of a record; give its value in the "
                "cell or model file, and leave it out of the map"
            )
    known.check_names((*model.names("inputs"), *model.names("outputs")), model.name)
    for name in known.constants:
        if name in model.names("outputs"):
            raise DataError(f"{name}: an output of model '{model.name}' is measured; only an input can be constant")
    if all(name in known.constants for name in model.names("inputs")):
        raise DataError(f"all inputs of model '{model.name}' are constant in the map; name the tag of one that moves")


def candidate(q: Quantity, signal: Signal) -> Candidate | None:
    """How well a tag suits a quantity; None where unit or size exclude it."""
    score = name_score(q, f"{signal.tag} {signal.description}")
    if signal.tag in (q.name, q.column):
        score = 1.5
    if signal.unit and not is_unit(signal.unit):
        return Candidate(score, score) if score >= NAMED else None  # refused where it is converted, with the reason
    if signal.unit and not fits(signal.unit, q.unit):
        return None
    units, usual = _units(q, signal)
    if not units and score < NAMED:
        return None
    return Candidate(score + 0.3 * bool(signal.unit) + 0.1 * bool(units) + 0.25 * usual, score)


def _units(q: Quantity, signal: Signal) -> tuple[tuple[str, ...], bool]:
    """Units in which the median of a signal would be one of ordinary operation (else: possible), and whether it is."""
    finite = signal.values[np.isfinite(signal.values)]
    middle = float(np.median(finite)) if len(finite) else np.nan
    given = (signal.unit,) if signal.unit else (q.unit, *other_units(q))
    if signal.tag == q.column and not signal.unit:
        given = (q.unit,)
    for low, high in filter(None, (q.usual, (q.lower, q.upper))):
        found = tuple(
            u for u in given if fits(u, q.unit) and low <= float(convert(np.array([middle]), u, q.unit)[0]) <= high
        )
        if found:
            return found, (low, high) == q.usual
    return (), False


def name_score(q: Quantity, text: str) -> float:
    """Share of the words of a quantity's name that a tag's name has, less what speaks against it.

    >>> q = Quantity("level_setpoint", "m", "")
    >>> name_score(q, "LIC_201.SP"), name_score(q, "LIC_201.PV")
    (1.0, -0.5)
    """
    parts = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)  # AirFlow, and pH as it stands
    tokens = [t for t in re.split(r"[^a-zäöüß]+", f"{text} {parts}".lower()) if t]
    has: set[str] = set()
    loops: set[str] = set()
    for token in tokens:
        has |= {word for word, spellings in WORDS.items() if token == word or token in spellings}
        if token[0] in LOOP_LETTERS and re.fullmatch(r"[a-z](?:i|t|ic|it|ir|rc|ica|irc|e)", token):
            loops.add(LOOP_LETTERS[token[0]])
    own = q.name.lower().split("_")
    share = len([w for w in own if w in has | loops or w in tokens]) / len(own)
    if loops - set(own) and not (has | loops) & (set(own) - {"setpoint"}):
        return -1.0
    against = any(word in has and word not in own for word in SPECIFIC)
    against |= any(word in tokens and CONTRARY[word] not in own for word in CONTRARY)
    against |= "setpoint" in own and any(word in tokens for word in PROCESS_VALUE)
    return share - against


def _assigned(
    wanted: Sequence[Quantity], signals: Sequence[Signal], model: Model, export: Export
) -> list[tuple[Quantity, Signal]]:
    """The assignment of tags to quantities with the largest sum of scores; each pair must be clearly best."""
    if not wanted:
        return []
    inputs = set(model.names("inputs"))
    table = [[candidate(q, s) for s in signals] for q in wanted]
    score = np.full((len(wanted), len(signals) + len(wanted)), IMPOSSIBLE)
    for i, row in enumerate(table):
        for j, found in enumerate(row):
            needs = -0.25 if wanted[i].name in inputs else NAMED
            if found is not None and found.named >= needs:
                score[i, j] = found.score
        score[i, len(signals) + i] = -5.0 if wanted[i].name in inputs else NAMED
    rows, columns = linear_sum_assignment(score, maximize=True)
    best = float(score[rows, columns].sum())
    pairs = []
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        q = wanted[i]
        if j >= len(signals):
            if q.name in inputs:
                raise DataError(_nothing_found(q, export))
            continue
        _check_clear(q, i, j, score, best, signals, table, export)
        pairs.append((q, signals[j]))
    return pairs


def _check_clear(
    q: Quantity,
    i: int,
    j: int,
    score: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    best: float,
    signals: Sequence[Signal],
    table: Sequence[Sequence[Candidate | None]],
    export: Export,
) -> None:
    other = score.copy()
    other[i, j] = IMPOSSIBLE
    rows, columns = linear_sum_assignment(other, maximize=True)
    k = int(columns[i])
    if k >= len(signals) or score[i, k] < score[i, j] - CLEAR or float(other[rows, columns].sum()) < best - CLEAR:
        return
    choices = [{"tag": signals[place].tag} for place in (j, k)]
    more = [
        {"tag": signals[m].tag}
        for m, c in enumerate(table[i])
        if m not in (j, k) and c is not None and score[i, m] > score[i, j] - CLEAR
    ]
    names = " and ".join(repr(c["tag"]) for c in choices)
    raise UnclearError(f"{export.file}: {q.name}: the tags {names} suit equally well", q.name, [*choices, *more])


def _nothing_found(q: Quantity, export: Export) -> str:
    tags = ", ".join(f"{s.tag} [{s.unit or '?'}]" for s in list(export.signals.values())[:8])
    return (
        f"{export.file}: no tag found for the input {q.name} [{q.unit}] (tags: {tags}); name it in a map (--map), as "
        f"'{q.name}: {{tag: ..., unit: ...}}'"
    )


def _no_unit(q: Quantity, tag: str, middle: float) -> str:
    """What is wrong with a tag whose values fit no unit that it could be in, and the line of a map that puts it right.

    A tag with the name of a record's column says its unit by that name; its values may be in another one all the same.
    """
    said = "names no unit"
    if tag == q.column:
        said = "is a fraction by its name" if q.unit == "-" else f"is in {q.unit} by its name"
    fitting = units_that_fit(q, middle)
    inside = [f"in {unit} it would be {value:.4g} {q.unit}".removesuffix(" -") for unit, value in fitting.items()]
    low, high = q.usual or (q.lower, q.upper)
    found = "; ".join(inside) or f"fits none (usual are {low:.3g} to {high:.3g} {q.unit})".replace(" -)", ")")
    line = map_line(q.name, {"tag": tag, "unit": next(iter(fitting))}) if fitting else f"{q.name}: {{unit: ...}}"
    advice = (
        f"{'if so,' if fitting else 'correct it, or'} give {'it' if fitting else 'its unit'} in a map (--map): {line}"
    )
    return f"tag {tag!r} {said}, and its median {middle:g} {'does not fit: ' if fitting else ''}{found}; {advice}"


def _one_unit(q: Quantity, keys: TagKeys, export: Export) -> str:
    signal = export.signals[keys.tag]
    if signal.unit:
        with located(f"{export.file}: {q.name}: tag {keys.tag!r}"):
            read_unit(signal.unit)
        return signal.unit
    units, _ = _units(q, signal)
    middle = float(np.nanmedian(signal.values))
    if len(units) == 1:
        return units[0]
    where = f"{export.file}: {q.name}: tag {keys.tag!r} names no unit, and its median {middle:g}"
    if not units:
        raise DataError(f"{export.file}: {q.name}: {_no_unit(q, keys.tag, middle)}")
    raise UnclearError(f"{where} fits several", q.name, [{"tag": keys.tag, "unit": u} for u in units])
