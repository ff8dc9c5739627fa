"""The three contracts: Plant, Estimator, Controller. A plug-in imports this package and the engine, nothing else.

State in, state out. An estimator or a controller is a frozen configuration plus compiled functions, ready when its
constructor returns. What changes from sample to sample is a frozen dataclass that is passed in and handed back. So a
run can be replayed, resumed from any step and compared to the bit. What the next step needs is *state*; what a plot or
a test needs is the *info* record (`Estimate`, `Decision`).

Time convention: the inputs of a sample are those held during the interval that ends at its time.

Map
---
status                What happened at one step.
sample                What the instruments show at one sampling instant.
estimator             `Setup`, `Prior`, `Estimate` and the contract `Estimator`.
track                 Estimates over a whole record, as arrays.
ensemble_record       Records of many members at once, for an estimator that tracks them all in one call.
batch                 The contract of a fit to a whole record at once, and what it returns.
controller            `ControllerSetup`, `Limits`, `Plan`, `Decision` and the contract `Controller`.
economics             `Economics`: what running a process earns and costs; `OperatingPoint`, what it reads.
plant                 `PlantRecord` and the contract `Plant`.
delayed_measurements  Delayed values put where they belong, for any estimator.
"""

from adaptive_flot.contracts.controller import (
    AnyController,
    Controller,
    ControllerSetup,
    DecidesAll,
    Decision,
    DecisionTable,
    Limits,
    Plan,
    TakesOver,
    TracksInputs,
)
from adaptive_flot.contracts.economics import Economics, OperatingPoint
from adaptive_flot.contracts.estimator import AnyEstimator, Estimate, Estimator, Prior, Setup, full_parameters
from adaptive_flot.contracts.plant import AnyPlant, Plant, PlantRecord
from adaptive_flot.contracts.sample import DelayedValue, Sample
from adaptive_flot.contracts.status import Status

__all__ = [
    "AnyController",
    "AnyEstimator",
    "AnyPlant",
    "Controller",
    "ControllerSetup",
    "DecidesAll",
    "Decision",
    "DecisionTable",
    "DelayedValue",
    "Economics",
    "Estimate",
    "Estimator",
    "Limits",
    "OperatingPoint",
    "Plan",
    "Plant",
    "PlantRecord",
    "Prior",
    "Sample",
    "Setup",
    "Status",
    "TakesOver",
    "TracksInputs",
    "full_parameters",
]
