"""One extended Kalman filter step on states and parameter coordinates together, as one compiled function.

Notation: z = (x, c) or, with an integrated random walk, (x, c, v): model state, parameter coordinates (see
`coordinates.py`), drift rates. The process noise w acts at the start of an interval, and everything measured at its end
is a function of z at its start::

    s_k = z_k + w_k, w ~ N(0, Q)         z_{k+1} = f(s_k)         y_{k+1} = g(s_k) + e, e ~ N(0, R)

so with F = df/ds and H = dg/ds, exact for the step itself, the sample is taken in two moves: correct s with
y (one output at a time, Joseph's form), then carry mean and covariance through F. That is the textbook filter with the
cross-covariance between state noise and measurement kept, without a matrix inverse, and never indefinite.

Source: Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), sections 5.2,
10.3; parameters as states: Ljung, IEEE Trans. Automatic Control 24 (1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from adaptive_flot.contracts import Prior, Setup
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.stepping.stepper import Stepper
from estimators.shared.coordinates import Coordinates

HOUR = 3600.0


@dataclass(frozen=True)
class Layout:
    """Sizes of z: nx states, q coordinates, and q rates where the random walk is integrated."""

    nx: int
    q: int
    integrated: bool

    @property
    def size(self) -> int:
        """Length of z."""
        return self.nx + self.q * (2 if self.integrated else 1)

    @property
    def coordinates(self) -> slice:
        """Where c lies in z."""
        return slice(self.nx, self.nx + self.q)


def layout(setup: Setup, *, integrated: bool = False) -> Layout:
    """Layout of z for a setup."""
    return Layout(len(setup.model.states), len(setup.parameters), integrated)


@dataclass(frozen=True)
class Linearised:
    """Symbols of one interval: arguments, f(z) before bounds, outputs (ny,), F (n, n), H of all outputs (ny, n)."""

    z: ca.SX
    t: ca.SX
    u: ca.SX
    p: ca.SX
    end: ca.SX
    outputs: ca.SX
    F: ca.SX
    H: ca.SX


def linearise_interval(setup: Setup, coordinates: Coordinates, shape: Layout) -> Linearised:
    """Prediction over one interval and its exact derivatives for z at its start."""
    jacobians = Stepper(setup.model, setup.dt).one_step_jacobians(setup.parameters)
    _, t, u, p = jacobians.sx_in()
    nx, q, n = shape.nx, shape.q, shape.size
    z = ca.SX.sym("z", n)
    moved = ca.SX.eye(q) if not shape.integrated else ca.horzcat(ca.SX.eye(q), setup.dt * ca.SX.eye(q))
    c = moved @ z[nx:]
    theta, slopes = coordinates.symbolic(c)
    p_now = ca.SX(p)
    p_now[setup.model.indices("parameters", setup.parameters)] = theta
    x_next, y, dx_dx, dx_dtheta, dy_dx, dy_dtheta = jacobians(z[:nx], t, u, p_now)
    by_c = ca.diag(slopes) @ moved
    below = ca.horzcat(ca.SX(q, nx), moved)
    rates = ca.horzcat(ca.SX(n - nx - q, nx + q), ca.SX.eye(n - nx - q))
    F = ca.vertcat(ca.horzcat(dx_dx, dx_dtheta @ by_c), below, rates)
    H = ca.horzcat(dy_dx, dy_dtheta @ by_c)
    return Linearised(z, t, u, p, ca.vertcat(x_next, c, z[nx + q :]), y, F, H)


def filter_step(setup: Setup, shape: Layout, outlier: float = np.inf) -> ca.Function:
    """Build the step.

    An innovation beyond `outlier` standard deviations s is not believed: its influence stays that of one of
    `outlier` s, and its log-likelihood falls linearly (Huber's weight; Durovic & Kovacevic, IEEE Trans. Automatic
    Control 44 (1999)). So one absurd value moves a state by a few of its standard deviations at most, and a step of the
    process is still followed.

    Returns
    -------
    casadi.Function
        `(z (n,), P (n, n), Q (n, n), t, u (nu,), p (np,), noise (m,), measured (m,), present (m,)) ->
        (z_next, P_next, prediction (ny,), expected_std (m,), log_likelihood, flags (2,))` for the m driving outputs;
        Q is the covariance of w over the interval, noise a standard deviation. flags: a number that is finite only if
        the whole result is, and how many parameters were projected onto their bounds.
    """
    return setup.model.derived(_filter_step, setup.dt, setup.parameters, setup.outputs, shape, outlier)


def _filter_step(
    model: Model, dt: float, parameters: tuple[str, ...], outputs: tuple[str, ...], shape: Layout, outlier: float
) -> ca.Function:
    coordinates = Coordinates.of(model, parameters)
    interval = linearise_interval(Setup(model, dt, parameters, outputs), coordinates, shape)
    rows = model.indices("outputs", outputs)
    m, n, robust = len(rows), shape.size, bool(np.isfinite(outlier))
    P, Q = ca.SX.sym("P", n, n), ca.SX.sym("Q", n, n)
    noise, measured, present = (ca.SX.sym(name, m) for name in ("noise", "measured", "present"))
    H, residual = interval.H[rows, :], measured - interval.outputs[rows]

    prior = P + Q
    expected = [ca.sqrt(H[j, :] @ prior @ H[j, :].T + noise[j] ** 2) for j in range(m)]
    moved, corrected, log_likelihood = ca.SX(n, 1), prior, ca.SX(0)
    for j in range(m):
        row = H[j, :]
        spread = corrected @ row.T
        variance = row @ spread + noise[j] ** 2
        error = residual[j] - row @ moved
        believed = ca.fmin(1, outlier * ca.sqrt(variance) / ca.fmax(ca.fabs(error), 1e-300)) if robust else 1
        gain = present[j] * spread / variance
        moved = moved + gain * believed * error
        # (I - K H) P (I - K H)' + K R K' as two moves of rank one
        left = corrected - gain @ spread.T
        corrected = left - (left @ row.T) @ gain.T + noise[j] ** 2 * gain @ gain.T
        log_likelihood -= (
            present[j] * (ca.log(2 * np.pi * variance) + believed * (2 - believed) * error**2 / variance) / 2
        )

    end = interval.end + interval.F @ moved
    carried = interval.F @ corrected @ interval.F.T
    carried = (carried + carried.T) / 2
    c = end[shape.coordinates]
    inside = ca.fmin(ca.fmax(c, coordinates.lower), coordinates.upper)
    flags = ca.vertcat(ca.sumsqr(end) + ca.sumsqr(carried) + ca.sumsqr(interval.outputs[rows]), ca.sum1(inside != c))
    end[shape.coordinates] = inside
    return ca.Function(
        "filter_step",
        [interval.z, P, Q, interval.t, interval.u, interval.p, noise, measured, present],
        [end, carried, interval.outputs, ca.vertcat(*expected), log_likelihood, flags],
        ["z", "P", "Q", "t", "u", "p", "noise", "measured", "present"],
        ["z_next", "P_next", "prediction", "expected_std", "log_likelihood", "flags"],
        {"cse": True},
    )


def process_noise(
    setup: Setup, coordinates: Coordinates, shape: Layout, drift_per_hour: FloatArray, state_noise: float
) -> FloatArray:
    """Covariance Q (n, n) of what moves z during one interval.

    Parameters
    ----------
    setup, coordinates, shape
        What z is.
    drift_per_hour
        Standard deviation of each parameter's drift within an hour, as a share of the parameter (q,): of a random walk
        of the coordinate, or of its rate from rest where the walk is integrated.
    state_noise
        Standard deviation that unknown disturbances add to each state within a second, as a share of its scale.
    """
    nx, q, dt = shape.nx, shape.q, setup.dt
    Q = np.zeros((shape.size, shape.size))
    scales = np.array([state.scale for state in setup.model.states])
    Q[:nx, :nx] = np.diag((state_noise * scales) ** 2 * dt)
    drift = drift_per_hour * coordinates.scale
    if shape.integrated:
        # a rate that does a random walk of intensity s from rest moves its integral by s t^3 / 3 in a time t
        Q[nx + q :, nx + q :] = np.diag(3 * drift**2 / HOUR**3 * dt)
    else:
        Q[nx:, nx:] = np.diag(drift**2 / HOUR * dt)
    return Q


def first_estimate(prior: Prior, coordinates: Coordinates, shape: Layout) -> tuple[FloatArray, FloatArray]:
    """Z (n,) and its covariance (n, n) from a prior; drift rates are zero.

    A direction of the coordinates that the prior leaves open beyond their range is taken as known to that range, whose
    standard deviation is that of a uniform distribution (see `_limited`). So is all of a batch fit that failed, whose
    covariance is NaN.
    """
    nx, q = shape.nx, shape.q
    c = np.clip(coordinates.from_parameters(prior.parameters), coordinates.lower, coordinates.upper)
    z, P = np.zeros(shape.size), np.zeros((shape.size, shape.size))
    z[:nx], z[shape.coordinates] = prior.state, c
    to_z = np.diag(np.concatenate([np.ones(nx), 1 / coordinates.slopes(c)]))
    joint = prior.joint_covariance
    if joint is None:
        joint = np.zeros((nx + q, nx + q))
        joint[nx:, nx:] = prior.covariance
    widest = (coordinates.upper - coordinates.lower) / np.sqrt(12.0)
    known = to_z @ joint @ to_z
    if not np.isfinite(known).all():
        known = np.diag(np.concatenate([np.zeros(nx), np.where(np.isfinite(widest), widest, coordinates.scale) ** 2]))
    P[: nx + q, : nx + q] = _limited(known, widest)
    return z, P


def _limited(P: FloatArray, widest: FloatArray) -> FloatArray:
    """Covariance (nx + q, nx + q) whose last q entries have no more than a standard deviation `widest` (q,).

    A record that says nothing along a direction leaves it open by any factor; a filter that linearises would then move
    by any factor. Each such direction is measured once, without moving the mean, so that its standard deviation becomes
    one unit of `widest`; the states that hang on it follow. What is known better, or has no range (infinity), is left
    as it is, to the bit.
    """
    q = len(widest)
    unit = np.where(np.isfinite(widest), widest, 2 * np.sqrt(np.maximum(q * np.diag(P)[-q:], 1e-300)))
    sizes, directions = np.linalg.eigh(P[-q:, -q:] / np.outer(unit, unit))
    if not (sizes > 1.0).any():
        return P
    # of the states, where the widest direction moves by one unit; what comes from a singular fit may be indefinite
    spread = np.sqrt(np.maximum(np.diag(P)[:-q], 0.0) / sizes.max())
    scale = np.concatenate([np.where(spread > 0, spread, 1.0), unit])
    scaled = P / np.outer(scale, scale)
    # by a factor of P: a variance of 1e14 would leave nothing of the others in a difference of covariances
    variances, axes = np.linalg.eigh(scaled)
    factor = axes * np.sqrt(np.maximum(variances, 0.0))
    for direction in directions[:, sizes > 1.0].T:
        a = factor[-q:].T @ direction
        variance = max(a @ a, 1.0)
        # (I - b a a')^2 = I - a a' (variance - 1) / variance^2: the measurement that leaves a variance of 1
        factor = factor - (1.0 - variance**-0.5) / variance * np.outer(factor @ a, a)
    limited: FloatArray = scale[:, None] * (factor @ factor.T) * scale
    return limited


def parameters_of(
    z: FloatArray, P: FloatArray, coordinates: Coordinates, shape: Layout
) -> tuple[FloatArray, FloatArray]:
    """Parameters (q,) and their covariance (q, q), to first order."""
    c = z[shape.coordinates]
    slopes = coordinates.slopes(c)
    return coordinates.to_parameters(c), P[shape.coordinates, shape.coordinates] * np.outer(slopes, slopes)


def parameters_of_rows(
    z: FloatArray, P: FloatArray, coordinates: Coordinates, shape: Layout
) -> tuple[FloatArray, FloatArray]:
    """The same for many rows: parameters (N, q) and covariances (N, q, q) from z (N, n) and P (N, n, n)."""
    where = shape.coordinates
    return of_coordinates(z[:, where], P[:, where, where], coordinates)


def of_coordinates(c: FloatArray, P: FloatArray, coordinates: Coordinates) -> tuple[FloatArray, FloatArray]:
    """Parameters (N, q) and their covariances (N, q, q) from coordinates (N, q) and theirs (N, q, q)."""
    log = np.array(coordinates.log)
    powers = np.exp(np.where(log, c, 0.0))
    slopes = np.where(log, powers, 1.0)
    values = np.clip(np.where(log, powers, c), coordinates.range[:, 0], coordinates.range[:, 1])
    return values, P * slopes[:, :, None] * slopes[:, None, :]
