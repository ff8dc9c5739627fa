"""Draw the README's picture: `python -m benchmarks.readme_figure` writes docs/paper_scenario_1.png."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure

from adaptive_flot.files import replace_path
from adaptive_flot.report import figures, series
from adaptive_flot.runner.scenario import load_scenario
from adaptive_flot.runner.study import run_scenario

TARGET = Path(__file__).parents[1] / "docs" / "paper_scenario_1.png"


def draw() -> Figure:
    """Scenario 1, seed 1: adapted parameters and grade, with truth, constant parameters and RPEM."""
    scenario = load_scenario("paper_scenario_1")
    (case,) = series.cases([(scenario, run_scenario(scenario, seeds=[1]))])
    return figures.time_figure([*series.parameter_panels(case), series.output_panels(case)[0]])


if __name__ == "__main__":
    stream = io.BytesIO()
    draw().savefig(stream, format="png", dpi=130, bbox_inches="tight")
    with replace_path(TARGET) as temporary:
        temporary.write_bytes(stream.getvalue())
    print(TARGET.relative_to(Path.cwd()) if TARGET.is_relative_to(Path.cwd()) else TARGET)
