"""Watch innovations: are they still white? Tests on one window after the other, with a known rate of false alarms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import ttest_1samp
from statsmodels.stats.diagnostic import acorr_ljungbox

from adaptive_flot.discovery.assessment.holm import holm
from adaptive_flot.greybox.model import FloatArray
from adaptive_flot.runner.scenario.discovery_options import FEWEST

LAGS = 10


@dataclass(frozen=True)
class Alarm:
    """What of a window is not white: p value of each test that was rejected, by output and test."""

    p_values: Mapping[str, float]

    def __str__(self) -> str:
        return ", ".join(f"{name} p = {p:.1g}" for name, p in self.p_values.items())


def watch(innovations: Mapping[str, FloatArray], false_alarm: float) -> Alarm | None:
    """Test a window of innovations for whiteness and zero mean.

    Each output takes two tests: Ljung and Box's for correlation over the first 10 lags (Biometrika 65 (1978)), and
    Student's for the mean. Both take the size of the noise from the window itself. Holm's correction (Scandinavian
    Journal of Statistics 6 (1979)) makes them one test of level `false_alarm`. White innovations of mean zero raise an
    alarm in at most that fraction of the windows. Both laws hold for large windows. Windows that do not overlap are
    independent, so the rate in time is `false_alarm / window`.

    Parameters
    ----------
    innovations
        Innovations of the window by output (N,), NaN where missing; an output with fewer than 50 is not tested.
    false_alarm
        Level of all tests together.

    Returns
    -------
    Alarm or None
        None where nothing speaks against white innovations.
    """
    p_values: dict[str, float] = {}
    for output, values in innovations.items():
        seen = values[np.isfinite(values)]
        if len(seen) >= FEWEST and np.ptp(seen) > 0:
            p_values[f"{output} correlation"] = float(acorr_ljungbox(seen, lags=[LAGS])["lb_pvalue"].iloc[0])
            p_values[f"{output} mean"] = float(ttest_1samp(seen, 0.0).pvalue)
    rejects = holm(p_values, false_alarm)
    shown = {name: p for name, p in p_values.items() if rejects[name]}
    return Alarm(shown) if shown else None
