"""Draw the README's picture of discovery.

`python -m benchmarks.pictures.discovery_figure` writes docs/pictures/discovery.png.

Residual, cause, error before and after: one record of `benchmarks.hidden_effects`, whose generator is a package apart.
Its cell entrains less rock when the froth is deep, with a kink that the catalogue of discovery does not hold.
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adaptive_flot.charts.palette import colour
from adaptive_flot.discovery.results import Discovery
from adaptive_flot.discovery.verdict.words.curve import effect_curves
from adaptive_flot.files import replace_path
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.parallel import available_processes
from adaptive_flot.processes.registry import make_model
from adaptive_flot.report.kit import style
from adaptive_flot.runner.commands.discover import discover_file
from benchmarks.hidden_effects.cell.constants import CELL_HEIGHT
from benchmarks.hidden_effects.effects.curves import STATIC
from benchmarks.hidden_effects.generate.folder import record_file, write_record
from benchmarks.hidden_effects.generate.record import make_record

SEED, RECORD = 1, 32
PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "discovery.png"
OUTPUT = "concentrate_grade"


def find() -> tuple[Discovery, dict[str, Any]]:
    """What discovery makes of the record, and the answer that it did not see."""
    record = make_record(SEED, RECORD)
    with tempfile.TemporaryDirectory() as folder:
        write_record(Path(folder), record)
        path = record_file(Path(folder), record.name)
        return discover_file(path, make_model(), processes=available_processes()), record.answer.as_dict()


def truth(effect: dict[str, Any], name: str, driver: FloatArray) -> FloatArray:
    """The factor that the generator puts on the site (K,), over the driver that was named: level and depth are one."""
    if {name, effect["driver"]} == {"level", "froth_depth"}:
        driver = CELL_HEIGHT - driver
    elif name != effect["driver"]:
        return np.full(len(driver), np.nan)  # another cause was named: there is no truth to draw over it
    scale, shape = effect["scale"], STATIC[effect["shape"]](effect["parameters"])
    z = (driver - scale["low"]) / (scale["high"] - scale["low"])
    factor: FloatArray = 1 + effect["amplitude"] * (np.array([shape(float(v)) for v in z]) - scale["centre"])
    return factor


@style.styled
def draw(discovery: Discovery, answer: dict[str, Any]) -> Figure:
    """Residual over time, curve of the effect with the truth, error on the report split."""
    figure = Figure(figsize=(style.WIDTH * 1.35, 3.1))
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.7, 1.5, 0.9))
    _residual(left, discovery)
    _cause(middle, discovery, answer)
    _errors(right, discovery)
    return figure


def _residual(ax: Axes, discovery: Discovery) -> None:
    assert discovery.problem is not None and discovery.before is not None and discovery.after is not None
    j = [discovery.model.outputs[c].name for c in discovery.problem.columns].index(OUTPUT)
    time = discovery.problem.record.time
    for fit, color, label in (
        (discovery.before, style.CONSTANT, "before"),
        (discovery.after, colour(0), "after"),
    ):
        ax.plot(time, 1e3 * fit.residual(discovery.problem)[:, j], color=color, lw=0.7, label=label)
    ax.set_title("Residual: measured − free run")
    ax.set_xlabel("time [s]")
    ax.set_ylabel("concentrate grade [10⁻³]")
    ax.legend(loc="lower left", ncols=2)
    ax.margins(x=0)


def _cause(ax: Axes, discovery: Discovery, answer: dict[str, Any]) -> None:
    assert discovery.problem is not None and discovery.after is not None
    (curve,) = effect_curves(discovery.problem, discovery.after, len(discovery.verdict.effects))
    ax.fill_between(1e3 * curve.driver, curve.low, curve.high, color=colour(0), alpha=0.22, lw=0)
    ax.plot(1e3 * curve.driver, curve.change, color=colour(0), label="found, 95 % band")
    true = truth(answer["effects"][0], curve.effect.driver, curve.driver)
    ax.plot(1e3 * curve.driver, true, color=style.TRUTH, lw=1.1, ls="--", label="truth")
    ax.axhline(1.0, color=style.CONSTANT, lw=1.0, ls=(0, (5, 1.5)))
    effect = curve.effect
    ax.set_title(f"Cause: {effect.site} by {effect.driver}".replace("_", " "))
    ax.set_xlabel(f"{effect.driver.replace('_', ' ')} [mm]")
    ax.set_ylabel(f"factor on {effect.site.replace('_', ' ')} [–]")
    ax.legend(loc="lower left" if curve.change[0] > curve.change[-1] else "lower right")


def _errors(ax: Axes, discovery: Discovery) -> None:
    change = next(c for c in discovery.verdict.error if c.output == OUTPUT)
    values = 1e3 * np.array([change.before, change.after])
    bars = ax.bar(["before", "after"], values, color=[style.CONSTANT, colour(0)], width=0.6)
    ax.bar_label(bars, labels=[f"{v:.2f}" for v in values])
    ax.axhline(1e3 * change.noise, color="black", lw=1.0, ls=(0, (4, 2)), label="noise")
    ax.set_title("Error, report split")
    ax.set_ylabel("RMS of grade [10⁻³]")
    ax.legend(loc="upper right")
    ax.margins(y=0.12)


def main() -> None:
    """Discover, draw, and print the verdict."""
    discovery, answer = find()
    print(discovery.verdict)
    print("truth:", [(e["site"], e["driver"], e["shape"]) for e in answer["effects"]])
    stream = io.BytesIO()
    draw(discovery, answer).savefig(stream, format="png", dpi=130, bbox_inches="tight")
    with replace_path(PICTURE) as temporary:
        temporary.write_bytes(stream.getvalue())
    print(f"docs/pictures/{PICTURE.name}")


if __name__ == "__main__":
    main()
