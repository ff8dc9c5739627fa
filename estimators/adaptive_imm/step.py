"""One interval of the whole estimator as one compiled function: mix, predict, correct, weigh, carry, combine."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Setup
from adaptive_flot.greybox.model import FloatArray
from estimators.adaptive_imm.bank import (
    Contamination,
    Mixing,
    Triangles,
    carried,
    combined,
    matched,
    output_variance,
    widened,
)
from estimators.adaptive_imm.interval import lagged_interval
from estimators.adaptive_imm.modes import Modes
from estimators.adaptive_imm.region import LongRun, no_narrower
from estimators.shared.coordinates import Coordinates
from estimators.shared.joint_filter import Layout

CARRIED = {
    "z": "z_next",
    "P": "P_next",
    "probability": "found",
    "lagged": "followed",
    "variance": "level",
    "count": "counted",
    "slow": "slowly",
}
"""Result that takes the place of each argument in the next interval."""
ARGUMENTS = [*CARRIED, "least", "t", "u", "p", "driving", "present", "doubt"]
RESULTS = [*CARRIED.values(), "prediction", "std", "mean", "covariance", "projected", "finite"]
MATRICES = ("z", "P", "slow", "z_next", "P_next", "slowly", "covariance")
"""Arguments and results that are matrices also where they have one column."""


@dataclass(frozen=True)
class Step:
    """What an interval depends on, beside the state and the sample.

    Attributes
    ----------
    modes, mixing, contamination
        The parts.
    fading
        Share of a discrepancy that is left after an interval.
    follow
        Share of the way to the estimate that the point of linearisation goes in an interval.
    reference_share
        Share of the covariance of the reference, the last mode, below which that of the parameters does not go.
    long_run
        What innovations that stay on one side add to it.
    noise_memory
        Samples over which the noise level is estimated; 0 takes that of the prior.
    """

    modes: Modes
    mixing: Mixing
    contamination: Contamination
    fading: float
    follow: float
    reference_share: float
    long_run: LongRun
    noise_memory: int

    @property
    def described(self) -> FloatArray:
        """1 for the modes that describe the process, 0 for the reference (M,)."""
        return np.array([float(kind != "reference") for kind in self.modes.kinds])

    def function(self, setup: Setup, shape: Layout) -> ca.Function:
        """Build the function, for M modes of n entries and m driving outputs.

        `doubt` is how far the modes with a right model are ruled out, from 0 to 1.

        Returns
        -------
        casadi.Function
            `(z (n, M), P (n (n + 1) / 2, M), probability (M,), lagged (q,), variance (m,), count (m,), slow (m, 4),
            least (m,), t, u (nu,), p (np,), driving (m,), present (m,), doubt) -> (z, P, probability, lagged, variance,
            count, slow, prediction (ny,), std (m,), mean (n,), covariance (q, q), projected, finite)`. The covariance
            is that of the coordinates, `slow` is of `LongRun`, `least` is the least variance of the noise. `projected`
            counts the parameters that were set onto their bounds in the most likely mode, and `finite` is finite where
            everything is. The probability of the reference is 1, beside those of the others.
        """
        coordinates, columns = (
            Coordinates.of(setup.model, setup.parameters),
            setup.model.indices("outputs", setup.outputs),
        )
        interval = lagged_interval(setup, shape)
        modes, m, nz, n = len(self.modes.kinds), len(columns), shape.size, shape.size + len(columns)
        triangles, where = Triangles(n), shape.coordinates
        z, P = ca.MX.sym("z", n, modes), ca.MX.sym("P", len(triangles.rows), modes)
        probability, lagged = ca.MX.sym("probability", modes), ca.MX.sym("lagged", shape.q)
        variance, count = ca.MX.sym("variance", m), ca.MX.sym("count", m)
        slow, least = ca.MX.sym("slow", m, LongRun.COLUMNS), ca.MX.sym("least", m)
        t, u, p = (ca.MX.sym(name, interval.size1_in(name)) for name in ("t", "u", "p"))
        driving, present, doubt = ca.MX.sym("driving", m), ca.MX.sym("present", m), ca.MX.sym("doubt")

        widths = variance @ ca.DM(self.modes.discrepancy[None, :] ** 2)
        mixed, spread, expected = self.mixing.expressions(z, P, probability, widths)
        expected *= ca.DM(self.described) * (1 - doubt * ca.DM(self.modes.discrepancy == 0))
        expected /= ca.sum1(expected)
        spread += ca.DM(triangles.on_diagonal(self.modes.noise.T)) + widened((1 - self.fading**2) * widths, triangles)
        point = mixed @ expected
        followed = lagged + self.follow * (point[where] - lagged)
        end, outputs, F, H = interval(point[:nz], followed, t, u, p)
        F, H = ca.diagcat(F, self.fading * ca.DM.eye(m)), ca.horzcat(H[columns, :], ca.DM.eye(m))
        base = outputs[columns] + point[nz:]
        away = mixed - ca.repmat(point, 1, modes)
        expects = output_variance(H, spread, modes) + (H @ away) ** 2
        after = self.contamination.correct(away, spread, H, driving - base, variance, present)
        weights = expected * ca.exp(after.log_likelihood.T - ca.mmax(after.log_likelihood))
        found = weights / ca.sum1(weights)
        kept = found + ca.DM(1 - self.described)
        level, counted = variance, count
        if self.noise_memory:
            counted = ca.fmin(count + present, self.noise_memory)
            level = ca.fmax(matched(variance, counted, after, found, H, driving - base, present), least)
        ends = ca.repmat(ca.vertcat(end, self.fading * point[nz:]), 1, modes) + F @ after.away
        c = ends[where, :]
        low, high = (ca.repmat(ca.DM(bound), 1, modes) for bound in (coordinates.lower, coordinates.upper))
        inside = ca.fmin(ca.fmax(c, low), high)
        ends = ca.vertcat(ends[: shape.nx, :], inside, ends[shape.nx + shape.q :, :])
        projected = ca.sum1(inside != c) @ (found >= ca.mmax(found))
        covariances = carried(after.P, F, modes)
        mean, covariance = combined(ends, covariances, found, found)
        prediction = ca.MX(outputs)
        prediction[columns] = base
        std = ca.sqrt(expects @ expected + variance)
        slowly, factor = self.long_run.expressions(slow, driving - base, std, present)
        shown = covariance[where, where]
        if self.reference_share > 0:
            _, reference = combined(ends, covariances, found, ca.MX(1 - self.described))
            shown = no_narrower(shape.q)(shown, reference[where, where], self.reference_share * (1 - doubt))
        shown *= factor
        whole = [ends, covariances, kept, level, slowly, shown]
        results = [ends, covariances, kept, followed, level, counted, slowly, prediction, std, mean, shown, projected]
        return ca.Function(
            "adaptive_imm_step",
            [z, P, probability, lagged, variance, count, slow, least, t, u, p, driving, present, doubt],
            [ca.densify(x) for x in (*results, sum(ca.sum1(ca.vec(x)) for x in whole))],
            ARGUMENTS,
            RESULTS,
            {"cse": True},
        )
