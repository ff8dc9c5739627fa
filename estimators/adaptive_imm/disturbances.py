"""Disturbances that nobody measures, as further parameters of the filter.

A step of the feed grade that is not measured looks like a step of n and C, but it comes slowly, through the cell. A
filter that knows of it tells them apart; one that does not puts it into n and C. It is taken to be at its nominal value
during the first record, which the batch fit took too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adaptive_flot.contracts import Prior, Setup


def with_disturbances(setup: Setup) -> Setup:
    """The setup with its unmeasured disturbances as last parameters."""
    return replace(setup, parameters=(*setup.parameters, *setup.unmeasured))


def extended(prior: Prior, setup: Setup) -> Prior:
    """The prior with the unmeasured disturbances at their nominal values."""
    count = len(setup.unmeasured)
    if not count:
        return prior
    nominal = setup.model.parameter_values[setup.model.indices("parameters", setup.unmeasured)]
    joint = None if prior.joint_covariance is None else np.pad(prior.joint_covariance, (0, count))
    values, covariance = np.append(prior.parameters, nominal), np.pad(prior.covariance, (0, count))
    return replace(prior, parameters=values, covariance=covariance, joint_covariance=joint)
