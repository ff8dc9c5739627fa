"""Plain SciPy version of the paper's study: the speed and correctness reference of the benchmarks.

The 87-litre cell written as an ordinary user would write it: a right-hand side with an inner root find, ``solve_ivp``
for every sampling interval and five simulations per update of the recursive prediction error method (RPEM).
It uses nothing of this project. All quantities are in SI units.

States ``x`` (9,):  Q_tails [m3/s], h_p [m], m_1, m_2 [kg], r_1 .. r_5 [-] (gas over gas-free pulp volume).
Inputs ``u`` (3,):  Q_air, Q_feed [m3/s], h_p set-point [m].
Parameters ``theta`` (2,):  n [-], C [m^n/s] of the froth bubble growth.

Row k of a table holds the inputs held over the interval that ends at t_k and the states and outputs at t_k.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp  # type: ignore[import-untyped, unused-ignore]
from scipy.optimize import brentq  # type: ignore[import-untyped, unused-ignore]

Array = NDArray[np.float64]
Method = Literal["RK45", "LSODA", "BDF", "Radau"]

AREA, V_CELL, H_CELL = 0.18, 0.087, 0.48  # m2, m3, m
PHI, RHO_S, RHO_W, MU_W, G = 0.2, 2650.0, 1000.0, 1.0e-3, 9.81  # -, kg/m3, kg/m3, Pa s, m/s2
D_BUBBLE = np.array([2.0e-4, 4.0e-4, 6.0e-4, 8.0e-4, 1.0e-3])  # m
PSI = np.array([500.0, 1300.0, 1700.0, 2000.0, 1200.0]) / 6700.0  # share of the air in each bubble class
BURST_A, BURST_B, BURST_C = -6.06e-4, 0.9182, 0.0  # m/s, -, s/m
C_PB, PLATEAU, PECLET = 50.0, 6.815, 0.15
P_FLOAT = np.array([2.8e-4, 3.0e-6])  # floatability of chalcopyrite, quartz
D_PARTICLE = np.array([7.5e-5, 7.3e-5])  # m
RHO_MINERAL = np.array([4200.0, 2650.0])  # kg/m3
C_FEED = np.array([10.6, 519.4])  # kg/m3
K_P, TAU_I = 3.0e-3, 150.0  # m2/s, s
THETA_NOMINAL = np.array([1.0, 6.38e-4])
Q_FEED, AIR_LIMITS, LEVEL_LIMITS, GRADE_NOISE = 1.67e-4, (9.05e-4, 2.17e-3), (0.33, 0.42), 1.0e-3

RHO_P = PHI * RHO_S + (1.0 - PHI) * RHO_W  # pulp density, kg/m3
MU_P = MU_W * math.exp(2.5 * PHI / (1.0 - 0.609 * PHI))  # pulp viscosity, Pa s
K_1 = RHO_P * G / (3.0 * C_PB * MU_P)  # 1/(m s)
V_STOKES = G * RHO_P * D_BUBBLE**2 / (18.0 * MU_P)  # bubble slip velocity without crowding, m/s
V_SET = G * (RHO_MINERAL - RHO_W) * D_PARTICLE**2 * (1.0 - PHI) ** 4.65 / (18.0 * MU_P * 3.0)  # m/s
STATE_SCALE = np.array([1e-4, 0.1, 0.1, 10.0, 1e-2, 1e-2, 1e-2, 1e-2, 1e-2])  # for the absolute tolerances


class Algebra(NamedTuple):
    """Quantities that follow from the state, the inputs and the parameters at one instant."""

    flux: Array  # v_k eps_k, (5,), m/s
    v_out: float  # m/s
    d_int: float  # m
    d_froth: float  # m
    v_g: float  # m/s
    alpha_star: float
    q_conc: float  # m3/s
    floated: Array  # V_cell P_i S_b R_f,i, (2,), m3/s
    entrained: Array  # Q_conc R_ent,i, (2,), m3/s


def froth_bubble_size(v_g: float, d_int: float, h_f: float, theta: Array) -> float:
    """Bubble size at the top of the froth [m] for gas velocity [m/s], interface size [m] and froth depth [m]."""
    n, c = theta
    return math.pow(n * c * h_f / v_g + math.pow(d_int, n), 1.0 / n)


def switch(alpha_star: float) -> float:
    """Weight of the branch alpha* >= 0.5: logistic of steepness 50."""
    return 1.0 / (1.0 + math.exp(-50.0 * (alpha_star - 0.5)))


def concentrate_flow(v_g: float, alpha_star: float, d_froth: float) -> float:
    """Concentrate flow [m3/s], the two branches blended."""
    w = switch(alpha_star)
    overflow = (1.0 - w) * alpha_star * (1.0 - alpha_star) + w * 0.25
    return PLATEAU * AREA * v_g**2 * overflow / (K_1 * d_froth**2)


def algebra(x: Array, u: Array, theta: Array) -> Algebra:
    """Solve v_g* by a root find and evaluate every algebraic quantity; x (9,), u (3,), theta (2,)."""
    q_tails, h_p, r = float(x[0]), float(x[1]), x[4:]
    q_air, q_feed = float(u[0]), float(u[1])
    eps = r / (1.0 + r.sum())
    flux = V_STOKES * (1.0 - eps) ** -1.39 * eps
    v_out = float(flux.sum())
    d_int = v_out / float((flux / D_BUBBLE).sum())
    h_f = H_CELL - h_p
    j_g = q_air / AREA
    v_burst = BURST_A + BURST_B * j_g + BURST_C * j_g**2
    v_max = (q_feed - q_tails + q_air) / AREA  # v_g* if nothing overflows
    if v_max <= v_burst:
        raise ValueError(f"no overflowing froth: v_g* <= {v_max:.3e} m/s, bursting rate {v_burst:.3e} m/s")

    def residual(v_g: float) -> float:
        d_froth = froth_bubble_size(v_g, d_int, h_f, theta)
        return v_g - v_max + concentrate_flow(v_g, 1.0 - v_burst / v_g, d_froth) / AREA

    v_g = float(brentq(residual, v_burst, v_max, xtol=1e-16, rtol=1e-15))
    alpha = 1.0 - v_burst / v_g
    d_froth = froth_bubble_size(v_g, d_int, h_f, theta)
    q_conc = concentrate_flow(v_g, alpha, d_froth)
    w = switch(alpha)
    size = math.sqrt(d_int / d_froth)
    r_f = ((1.0 - w) * (alpha * (1.0 - alpha) * v_g / V_SET) ** 0.25 + w * (v_g / (4.0 * V_SET)) ** 0.25) * size
    d_axial = j_g**1.5 / (math.sqrt(K_1 * (math.sqrt(3.0) - math.pi / 2.0)) * PECLET)
    drop = V_SET**1.5 * h_f / d_axial
    r_ent = (1.0 - w) * np.exp(-drop / math.sqrt(v_g * (1.0 - alpha))) + w * np.exp(-2.0 * drop / math.sqrt(v_g))
    floated = V_CELL * P_FLOAT * (6.0 * v_g / d_int) * r_f
    return Algebra(flux, v_out, d_int, d_froth, v_g, alpha, q_conc, floated, q_conc * r_ent)


def rhs(t: float, x: Array, u: Array, theta: Array) -> Array:
    """Time derivative of the states, (9,), at time t [s] (unused); x (9,), u (3,), theta (2,)."""
    z = algebra(x, u, theta)
    q_tails, h_p, m, r = x[0], x[1], x[2:4], x[4:]
    q_air, q_feed, h_sp = u
    dh = z.v_g - z.v_out
    dq_tails = K_P * dh + K_P / TAU_I * (h_p - h_sp)
    dm = C_FEED * q_feed - m / (AREA * h_p) * (q_tails + z.floated + z.entrained)
    net = q_feed - q_tails - z.q_conc
    dr = (1.0 + r.sum()) / (AREA * h_p) * (q_air * PSI - AREA * z.flux - net * r)
    return np.concatenate(([dq_tails, dh], dm, dr))


def outputs(x: Array, u: Array, theta: Array) -> dict[str, float]:
    """Evaluate the outputs at one instant, named as the columns of the reference tables; x (9,), u (3,), theta (2,)."""
    z = algebra(x, u, theta)
    f = x[2:4] / (AREA * x[1]) * (z.floated + z.entrained)  # kg/s to the concentrate
    return {
        "concentrate_grade": float(f[0] / f.sum()),
        "recovery": float(f[0] / (C_FEED[0] * u[1])),
        "air_recovery": float(z.alpha_star * z.v_g * AREA / u[0]),
        "concentrate_flow_m3_s": z.q_conc,
        "interfacial_gas_velocity_m_s": z.v_g,
        "interface_bubble_size_m": z.d_int,
        "froth_bubble_size_m": z.d_froth,
        "alpha_star": z.alpha_star,
    }


def steady_state(u: Array, theta: Array) -> Array:
    """Steady state (9,) for constant u (3,) and theta (2,): h_p = h_p_SP and v_g* = Q_air / A, the rest follows."""
    q_air, q_feed, h_sp = (float(v) for v in u)
    j_g = q_air / AREA
    # class k leaves the pulp as fast as it comes in: v_k(eps_k) eps_k = j_g psi_k
    eps = np.empty(5)
    for k, (v, p) in enumerate(zip(V_STOKES, PSI, strict=True)):
        eps[k] = brentq(lambda e, v=v, p=p: v * e * (1.0 - e) ** -1.39 - j_g * p, 0.0, 0.9, xtol=1e-16, rtol=1e-15)
    d_froth = froth_bubble_size(j_g, 1.0 / float((PSI / D_BUBBLE).sum()), H_CELL - h_sp, theta)
    alpha = 1.0 - (BURST_A + BURST_B * j_g + BURST_C * j_g**2) / j_g
    q_tails = q_feed - concentrate_flow(j_g, alpha, d_froth)
    x = np.concatenate(([q_tails, h_sp, 0.0, 0.0], eps / (1.0 - eps.sum())))
    z = algebra(x, u, theta)
    x[2:4] = AREA * h_sp * C_FEED * q_feed / (q_tails + z.floated + z.entrained)
    return x


def step(
    x: Array,
    u: Array,
    theta: Array,
    dt: float = 1.0,
    rtol: float = 1e-8,
    atol: Array | None = None,
    method: Method = "LSODA",
) -> Array:
    """State (9,) after dt [s] with u (3,) and theta (2,) held; atol (9,) defaults to rtol times typical sizes."""
    tolerance = rtol * STATE_SCALE if atol is None else atol
    sol: Any = solve_ivp(rhs, (0.0, dt), x, method=method, args=(u, theta), rtol=rtol, atol=tolerance)
    if not sol.success:
        raise RuntimeError(f"integration failed: {sol.message}")
    return np.asarray(sol.y[:, -1], dtype=np.float64)


def simulate(inputs: Array, thetas: Array, x0: Array, rtol: float = 1e-8) -> tuple[Array, dict[str, Array]]:
    """Hold each row of inputs (N,3), thetas (N,2) for 1 s from x0 (9,); states (N,9) and outputs (N,) at the ends."""
    states = np.empty((len(inputs), len(x0)))
    x = x0
    for k, (u, theta) in enumerate(zip(inputs, thetas, strict=True)):
        x = step(x, u, theta, rtol=rtol)
        states[k] = x
    rows = [outputs(x, u, theta) for x, u, theta in zip(states, inputs, thetas, strict=True)]
    return states, {name: np.array([row[name] for row in rows]) for name in rows[0]}


class RpemResult(NamedTuple):
    """What the recursion leaves behind; row k belongs to sample k."""

    theta: Array  # estimates after each sample, (N,2)
    grade: Array  # one-step predictions made before each sample was used, (N,)
    states: Array  # predicted states, (N,9)
    gradient: Array  # central differences of the prediction, (N,2)
    inverse_hessian: Array  # L after the last sample, (2,2)


def rpem(
    x0: Array, theta0: Array, l0: Array, inputs: Array, grade: Array, *,
    forgetting: float = 0.995, fd_step: float = 1e-4, rtol: float = 1e-8, method: Method = "LSODA",
) -> RpemResult:  # fmt: skip
    """Run the recursive prediction error method of the paper (1 s sampling), five simulations per sample.

    x0 (9,) and theta0 (2,) are the state and the estimate before the first sample, l0 (2,2) the initial inverse
    Hessian; row k of inputs (N,3) is held over the second that ends at the measurement grade[k] of grade (N,).
    fd_step is the central-difference step relative to each parameter (n and C differ by three decades).
    """

    def predict(x: Array, u: Array, theta: Array) -> tuple[Array, float]:
        x_next = step(x, u, theta, rtol=rtol, method=method)
        return x_next, outputs(x_next, u, theta)["concentrate_grade"]

    count = len(grade)
    thetas, predictions, states, gradients = (np.empty((count, *shape)) for shape in ((2,), (), (9,), (2,)))
    x, theta, l_matrix = x0, np.array(theta0, dtype=np.float64), np.array(l0, dtype=np.float64)
    for k in range(count):
        u = inputs[k]
        x_next, g = predict(x, u, theta)
        psi = np.empty(2)
        for j in range(2):
            delta = np.zeros(2)
            delta[j] = fd_step * abs(theta[j])
            psi[j] = (predict(x, u, theta + delta)[1] - predict(x, u, theta - delta)[1]) / (2.0 * delta[j])
        l_psi = l_matrix @ psi
        l_matrix = (l_matrix - np.outer(l_psi, l_psi) / (forgetting + psi @ l_psi)) / forgetting
        theta = theta + l_matrix @ psi * (grade[k] - g)
        x = x_next
        thetas[k], predictions[k], states[k], gradients[k] = theta, g, x, psi
    return RpemResult(thetas, predictions, states, gradients, l_matrix)


def scenario(end: int, seed: int) -> tuple[Array, Array]:
    """Make inputs (end,3) and true parameters (end,2) at t = 1 .. end s (at most 2400) like the paper's scenario 1."""
    t = np.arange(1, end + 1)
    air = np.linspace(*AIR_LIMITS, 40)[(t - 1) // 60]
    level = np.random.default_rng(seed).uniform(*LEVEL_LIMITS, 15)[(t - 1) // 160]
    n = THETA_NOMINAL[0] * np.interp(t, [1200, 1800], [1.0, 1.2])
    c = THETA_NOMINAL[1] * np.interp(t, [600, 1200], [1.0, 1.2])
    return np.column_stack([air, np.full(end, Q_FEED), level]), np.column_stack([n, c])


def main() -> None:
    """Time the RPEM on a simulated record, started at t = 600 s from the true state and the nominal parameters."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--steps", type=int, default=200, help="updates after t = 600 s, at most 1800")
    parser.add_argument("--seed", type=int, default=0, help="seed of the level set-points and of the noise")
    args = parser.parse_args()
    if not 1 <= args.steps <= 1800:
        parser.error("--steps must be in 1 .. 1800")
    start, end = 600, 600 + args.steps
    inputs, thetas = scenario(end, args.seed)
    states, truth = simulate(inputs, thetas, steady_state(inputs[0], thetas[0]))
    grade = truth["concentrate_grade"] + GRADE_NOISE * np.random.default_rng(args.seed + 1).standard_normal(end)
    l0 = np.diag((0.01 * THETA_NOMINAL / GRADE_NOISE) ** 2)  # 1 % standard deviation over the noise variance
    begin = time.perf_counter()
    result = rpem(states[start - 1], THETA_NOMINAL, l0, inputs[start:], grade[start:])
    seconds = (time.perf_counter() - begin) / args.steps
    print(f"last estimate n, C: {result.theta[-1]}, true: {thetas[-1]}")
    print(f"{args.steps} updates, {seconds:.6f} s per update")


if __name__ == "__main__":
    main()
