"""What says the same at a site of a model as an amount or a factor where it has none."""

from __future__ import annotations

import casadi as ca
import numpy as np

from adaptive_flot.discovery.candidates.catalogue import passed_on
from adaptive_flot.discovery.further_sites.places import BALANCE, DRAG, LOSS, READING, is_part
from adaptive_flot.greybox.effects import Effect, Mode
from adaptive_flot.greybox.model import FloatArray, Model
from adaptive_flot.greybox.quantities import Parameter
from adaptive_flot.greybox.scope import Site

POINTS, WIDE, SAME = 24, 1e6, 1e-9
"""Points at which the rates of a model are compared, what stands for no limit of a quantity, and the share of a change
from which two differ."""


def is_same_part(model: Model, place: str, site: str) -> bool:
    """Whether a further site is the part of a site: an amount beside its factor, or what is asked of it alone.

    A valve that gives a third less, and one that is opened by a tenth less than the record says, are one part.
    """
    return is_part(place, site) or (
        place.startswith(READING) and passed_on(model).get(site) == place.removeprefix(READING)
    )


def is_meant(model: Model, effect: Effect, place: str, *, does_the_same: bool = False) -> bool:
    """Whether an effect says the same as a change at a further site; or does the same, whatever it says.

    An amount at a site that stands for one, or beside the factor of the site; an input that is asked of the actuator
    whose site it passes; and whatever else in the process does the same to every state and output, as a capacity does.
    A drive that alone moves a mass does what another mass would do, but it does not mean that. Nor does an amount at an
    outlet that changes by a factor: what something adds to the balance may be anything.
    """
    site = _site(model, effect.site)
    mode = effect.mode or site.mode
    if is_same_part(model, place, site.name):
        return True
    if site.role == "sensor":
        return False
    is_amount = mode == site.mode == "offset"
    if is_amount and place.startswith(BALANCE):
        return True
    if is_amount and place.startswith((LOSS, DRAG)):
        state = place.removeprefix(LOSS).removeprefix(DRAG)
        moved = _moves(model, site.name, mode)[:, model.index("states", state)]
        return bool(np.any(np.isfinite(moved) & (moved != 0)))
    if not does_the_same and place.startswith(BALANCE) and mode == "offset" != site.mode:
        return False
    if not does_the_same and (site.role in ("actuator", "feed") or (place.startswith(READING) and not is_amount)):
        return False
    return _are_the_same(_moves(model, site.name, mode), _moves(model, place, _site(model, place).mode))


def twins(model: Model, effect: Effect) -> tuple[Site, ...]:
    """Other sites at which an effect does the same to all states and outputs, up to a constant factor.

    So do forces that add up: what depends on the position may be the spring, the damper or the drive.
    """
    mode = effect.mode or _site(model, effect.site).mode
    own = _moves(model, effect.site, mode)
    others = (s for s in model.sites if s.name != effect.site and s.role != "sensor")
    return tuple(s for s in others if _are_the_same(_moves(model, s.name, mode), own))


def constants_alike(model: Model, effect: Effect) -> tuple[Parameter, ...]:
    """Fixed constants whose error does the same as a constant effect: one of them may be off, and nothing has failed.

    A compressor that gives 6 % more than was asked, and a capacity that is 6 % above the data sheet, are one.
    """
    site = _site(model, effect.site)
    if effect.driver != "constant" or (effect.mode or site.mode) != "factor":
        return ()
    own = _moves(model, effect.site, "factor")
    fixed = [q for q in model.parameters if q.role == "fixed" and q.value != 0 and "." not in q.name]
    return tuple(q for q in fixed if _are_the_same(own, _moves_by(model, q.name)))


def _site(model: Model, name: str) -> Site:
    return next(s for s in model.sites if s.name == name)


def _are_the_same(one: FloatArray, two: FloatArray) -> bool:
    """Whether two changes move rates and outputs (POINTS, nx + ny) in one proportion, where the model has values."""
    known = np.isfinite(one).all(axis=1) & np.isfinite(two).all(axis=1)
    one, two = one[known], two[known]
    if known.sum() < POINTS // 4 or not np.any(one) or not np.any(two):
        return False
    factor = float(np.sum(one * two) / np.sum(two * two))
    return bool(np.abs(one - factor * two).max() <= SAME * np.abs(one).max())


def _moves(model: Model, site: str, mode: Mode) -> FloatArray:
    """How rates and outputs answer to a small change at a site (POINTS, nx + ny): their derivatives by its size."""
    changed = model.with_effects([Effect(site, "constant", "shift", {"amplitude": 0.0}, mode=mode)])
    return _moves_by(changed, changed.effects[-1].parameter("amplitude"))


def _moves_by(model: Model, parameter: str) -> FloatArray:
    """The same for a parameter. The points are random, within the ranges of states and inputs."""
    ends = np.array([(q.lower, q.upper) for q in (*model.states, *model.inputs)])
    low, high = np.clip(ends.T, -WIDE, WIDE)
    points = np.random.default_rng(0).uniform(low, high, (POINTS, len(low)))
    k = model.index("parameters", parameter)
    x, u, p = (
        ca.SX.sym(name, len(kind)) for name, kind in (("x", model.states), ("u", model.inputs), ("p", model.parameters))
    )
    rates, outputs, *_ = model.ode(0.0, x, u, p)
    by = ca.Function("by", [x, u, p], [ca.densify(ca.jacobian(ca.vertcat(rates, outputs), p[k]))])
    nx, values = len(model.states), model.parameter_values
    return np.array([np.array(by(point[:nx], point[nx:], values)).ravel() for point in points])
