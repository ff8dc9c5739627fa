"""Draw the README's pictures: `python -m benchmarks.pictures.readme_figure` writes them to docs/pictures/."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure

from adaptive_flot.files import replace_path
from adaptive_flot.report.kit import figures
from adaptive_flot.report.run import series
from adaptive_flot.report.run.control import closed_loop
from adaptive_flot.runner.commands.runs.run import run_scenario
from adaptive_flot.runner.scenario.loading import load_scenario

FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
CLOSED_LOOP = ("air flow", "concentrate grade", "recovery")


def draw_paper_scenario() -> Figure:
    """Scenario 1, seed 1: adapted parameters and grade, with truth, constant parameters and RPEM."""
    scenario = load_scenario("paper_scenario_1")
    (case,) = series.cases([(scenario, run_scenario(scenario, seeds=[1]))])
    return figures.time_figure([*series.parameter_panels(case), series.output_panels(case)[0]])


def draw_closed_loop() -> Figure:
    """closed_loop_drift, seed 1, economic MPC: air flow, grade and recovery with RPEM, fixed and true parameters."""
    scenario = load_scenario("closed_loop_drift")
    case = series.cases([(scenario, run_scenario(scenario, ["rpem", "fixed", "oracle"], [1]))])[0]
    assert case.controller == "economic_mpc"
    return figures.time_figure([p for p in closed_loop.operation_panels(case) if p.label in CLOSED_LOOP])


PICTURES = {"paper_scenario_1.png": draw_paper_scenario, "closed_loop_drift.png": draw_closed_loop}

if __name__ == "__main__":
    for name, draw in PICTURES.items():
        stream = io.BytesIO()
        draw().savefig(stream, format="png", dpi=130, bbox_inches="tight")
        with replace_path(FOLDER / name) as temporary:
            temporary.write_bytes(stream.getvalue())
        print(f"docs/pictures/{name}")
