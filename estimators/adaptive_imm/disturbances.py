"""Disturbances that nobody measures, as further parameters of the filter.

A step of the feed grade that is not measured looks like a step of n and C, but it comes slowly, through the cell. A
filter that knows of it tells them apart; one that does not puts it into n and C. It is taken to be at its nominal value
during the first record, which the batch fit took too. An estimator that starts again goes on with what it had found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import Prior, Setup


def with_disturbances(setup: Setup) -> Setup:
    """The setup with its unmeasured disturbances as last parameters."""
    return replace(setup, parameters=(*setup.parameters, *setup.unmeasured))


def extended(prior: Prior, setup: Setup) -> Prior:
    """The prior with the unmeasured disturbances as far as it knows them, and else at their nominal values."""
    names = setup.unmeasured
    if not names:
        return prior
    nominal = setup.model.parameter_values[setup.model.indices("parameters", names)].tolist()
    known = [prior.disturbances.get(name, (value, 0.0)) for name, value in zip(names, nominal, strict=True)]
    own = np.diag([0.0] * len(prior.parameters) + [std**2 for _, std in known])
    joint = prior.joint_covariance
    if joint is not None:
        joint = np.pad(joint, (0, len(names)))
        joint[-len(names) :, -len(names) :] = own[-len(names) :, -len(names) :]
    return replace(
        prior,
        parameters=np.append(prior.parameters, [value for value, _ in known]),
        covariance=np.pad(prior.covariance, (0, len(names))) + own,
        joint_covariance=joint,
    )
