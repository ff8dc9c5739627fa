"""What a plug-in returned, checked where it enters the loop: a wrong shape is named where it was made."""

from __future__ import annotations

from typing import Any

import numpy as np

from adaptive_flot.contracts import AnyController, AnyEstimator, DecidesAll, Decision, DecisionTable, Estimate
from adaptive_flot.errors import PluginError
from adaptive_flot.plugins import method_place


def checked_estimate(estimator: AnyEstimator, returned: Any) -> tuple[Any, Estimate]:
    """State and estimate that `update` returned.

    Raises
    ------
    PluginError
        It is no pair of state and `Estimate`, or an array has another shape than the contract says.
    """
    made = getattr(estimator, "estimator", estimator)  # what delayed measurements are put in place for
    if not (isinstance(returned, tuple) and len(returned) == 2 and isinstance(returned[1], Estimate)):
        raise PluginError(f"{method_place(made, 'update')}: returned {_kind(returned)}; return (state, Estimate)")
    setup, estimate = estimator.setup, returned[1]
    states, outputs = len(setup.model.states), len(setup.model.outputs)
    adapted, driving = len(setup.parameters), len(setup.outputs)
    shapes = {
        "prediction": (outputs,),
        "innovation": (outputs,),
        "innovation_std": (driving,),
        "parameters": (adapted,),
        "covariance": (adapted, adapted),
        "state": (states,),
    }
    for name, shape in shapes.items():
        _check_shape(made, "update", f"Estimate.{name}", getattr(estimate, name), shape)
    if estimate.discrepancy is not None:
        _check_shape(made, "update", "Estimate.discrepancy", estimate.discrepancy, (outputs,))
    return returned[0], estimate


def checked_decision(controller: AnyController, returned: Any, inputs: int) -> tuple[Any, Decision]:
    """State and decision that `decide` returned; the plant has so many inputs.

    Raises
    ------
    PluginError
        It is no pair of state and `Decision`, or the inputs are not one finite number each.
    """
    if not (isinstance(returned, tuple) and len(returned) == 2 and isinstance(returned[1], Decision)):
        raise PluginError(f"{method_place(controller, 'decide')}: returned {_kind(returned)}; return (state, Decision)")
    decision = returned[1]
    _check_shape(controller, "decide", "Decision.inputs", decision.inputs, (inputs,))
    if not np.isfinite(decision.inputs).all():
        place = method_place(controller, "decide")
        raise PluginError(f"{place}: Decision.inputs = {decision.inputs} is not finite; return finite inputs")
    return returned[0], decision


def checked_decisions(controller: DecidesAll, intervals: int, inputs: int) -> DecisionTable:
    """Decisions of all intervals of an open loop, whose plant has so many inputs.

    Raises
    ------
    PluginError
        They are no `DecisionTable`, or the inputs are not one finite number each.
    """
    table = controller.decide_all(intervals)
    if not isinstance(table, DecisionTable):
        place = method_place(controller, "decide_all")
        raise PluginError(f"{place}: returned {_kind(table)}; return a DecisionTable")
    _check_shape(controller, "decide_all", "DecisionTable.inputs", table.inputs, (intervals, inputs))
    if not np.isfinite(table.inputs).all():
        place = method_place(controller, "decide_all")
        raise PluginError(f"{place}: DecisionTable.inputs is not finite; return finite inputs")
    return table


def _check_shape(plugin: object, method: str, what: str, value: Any, shape: tuple[int, ...]) -> None:
    if not isinstance(value, np.ndarray) or value.shape != shape:
        got = f"has shape {value.shape}" if isinstance(value, np.ndarray) else f"is {_kind(value)}"
        raise PluginError(f"{method_place(plugin, method)}: {what} {got}; return an array of shape {shape}")


def _kind(value: object) -> str:
    return "None" if value is None else f"a {type(value).__name__}"
