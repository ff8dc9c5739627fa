# %% [markdown]
# # 6. A study of a thousand runs
#
# One run says little: the noise of another day gives another fit. A study is a small file that names scenarios,
# estimators and seeds. It runs on all cores, or on a cluster, and goes on where it was when it is interrupted.

# %%
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd

COUNT = int(os.environ.get("EXAMPLE_SEEDS", "500"))
OUT = Path("results/examples/a_study_of_a_thousand_runs")
OUT.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# Two estimators with 500 seeds each are a thousand runs. An estimator of one's own goes in as
# `{use: my_file:MyEstimator, options: {gain: 0.1}}`, with its file beside this one.

# %%
study = OUT / "drift_1000.yaml"
study.write_text(f"""\
description: "Paper, scenario 1: fixed parameters and the recursive method, {COUNT} seeds"
scenarios: [paper_scenario_1]
estimators: [fixed, rpem]
seeds: {{first: 1, count: {COUNT}}}
""")

# %% [markdown]
# A study is a command, since it starts processes of its own: `adaptive-flot sweep drift_1000.yaml`. Stop it, and the
# same command goes on; a run that is there is not done again.

# %%
folder = OUT / "runs"
command = [sys.executable, "-m", "adaptive_flot", "sweep", str(study), "--out", str(folder)]
subprocess.run(command, check=True)

# %% [markdown]
# Its table has a row a run, with the fits, the statuses and, for closed loops, the account.

# %%
table = pd.read_parquet(folder / "runs.parquet")
fits = [column for column in table if column.startswith("fit_")]
print(table.groupby("estimator")[fits].describe(percentiles=[0.05, 0.5, 0.95]).T.unstack(level=0).T.round(2))
worst = table[table["estimator"] == "rpem"].nsmallest(3, fits[0])[["seed", *fits]]
print("The three worst runs of rpem, to be looked at one by one with af.run(..., seeds=[seed]):")
print(worst.to_string(index=False))
