"""Small models whose estimates have closed forms, and records of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from adaptive_flot.greybox.data.dataset import Dataset
from adaptive_flot.greybox.model import FloatArray, Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.record import RecordSimulator


def linear(q: int, m: int = 1, *, value: float = 0.0, **parameter: float) -> Model:
    """y_j = sum_i th_i u_{j,i}, j = 1 .. m, with one idle state: least squares in q parameters."""

    def equations(s: Scope) -> None:
        s.derivative("idle", -s.state("idle"))
        for j in range(m):
            s.output(f"y{j}", ca.dot(_column(s.parameter, "th", q), _column(s.input, f"u{j}_", q)))

    return Model(
        name="linear",
        states=(Quantity("idle", "-", ""),),
        inputs=tuple(Quantity(f"u{j}_{i}", "-", "") for j in range(m) for i in range(q)),
        parameters=tuple(
            replace(Parameter(f"th{i}", value, "-", ""), role="estimated", **parameter)  # type: ignore[arg-type]
            for i in range(q)
        ),
        outputs=tuple(Quantity(f"y{j}", "-", "") for j in range(m)),
        equations=equations,
    )


def _column(symbol: Callable[[str], ca.SX], stem: str, count: int) -> ca.SX:
    return ca.vertcat(*(symbol(f"{stem}{i}") for i in range(count)))


def decay(a: float = 0.4, b: float = 1.0, *, prior_std: float | None = None) -> Model:
    """dx/dt = -a x + b u, y = x: two parameters that a changing input tells apart."""

    def equations(s: Scope) -> None:
        s.derivative("x", s.parameter("b") * s.input("u") - s.parameter("a") * s.state("x"))
        s.output("y", s.state("x"))

    return Model(
        name="decay",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(
            Parameter("a", a, "1/s", "", None, 0.01, 10.0, 0.4, prior_std, "estimated"),
            Parameter("b", b, "1/s", "", None, 0.0, 10.0, 1.0, prior_std, "estimated"),
        ),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def product() -> Model:
    """y = a b u: the record knows the product only."""

    def equations(s: Scope) -> None:
        s.derivative("idle", -s.state("idle"))
        s.output("y", s.parameter("a") * s.parameter("b") * s.input("u"))

    return Model(
        name="product",
        states=(Quantity("idle", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=tuple(Parameter(n, 1.0, "-", "", None, 0.0, 10.0, 1.0) for n in "ab"),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def square() -> Model:
    """dx/dt = p - x^2 + u, y = g x: no steady state, and then no state at all, where p + u < 0."""

    def equations(s: Scope) -> None:
        s.derivative("x", s.parameter("p") + s.input("u") - s.state("x") ** 2)
        s.output("y", s.parameter("g") * s.state("x"))

    return Model(
        name="square",
        states=(Quantity("x", "-", "", 0.0),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("p", 1.0, "-", "", None, -5.0, 5.0, 1.0), Parameter("g", 1.0, "-", "")),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def root() -> Model:
    """dx/dt = -x, y = th sqrt(u): the output is not finite where u < 0, the state always is."""

    def equations(s: Scope) -> None:
        s.derivative("x", -s.state("x"))
        s.output("y", s.parameter("th") * ca.sqrt(s.input("u")))

    return Model(
        name="root",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("th", 1.0, "-", "", None, 0.0, 10.0, 1.0),),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


def record(
    model: Model,
    inputs: ArrayLike,
    *,
    parameters: Mapping[str, float] | None = None,
    x0: Sequence[float] = (0.0,),
    noise: FloatArray | float = 0.0,
    given: bool = True,
) -> Dataset:
    """Simulated record of a model with other parameters; row 0 is the initial instant, and measured too."""
    u = np.asarray(inputs, dtype=float).reshape(len(np.asarray(inputs)), -1)
    time = np.arange(len(u), dtype=float)
    start = np.array(x0)
    empty = Dataset("toy", time, 1.0, u, np.full((len(u), len(model.outputs)), np.nan))
    values = model.with_parameters(parameters or {}).parameter_values
    outputs = RecordSimulator(model, 1.0).outputs(empty, start, values)
    return replace(empty, outputs=outputs + noise, initial_state=start if given else None)


def measured_as(data: Dataset, outputs: FloatArray) -> Dataset:
    """The same record with other measurements."""
    return replace(data, outputs=np.asarray(outputs, dtype=float).reshape(len(data), -1))
