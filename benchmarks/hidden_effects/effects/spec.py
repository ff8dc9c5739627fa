"""An effect as plain data, and how it becomes a factor in the cell (`Influence`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from benchmarks.hidden_effects.cell.equations import Influence, Signals
from benchmarks.hidden_effects.cell.sites import INDEX, SENSOR_SITES, STATE_DRIVERS
from benchmarks.hidden_effects.effects import curves

GRADE_FOLLOWS = 5.0  # s; a froth feels the grade that reaches it, and no algebraic loop arises
SMALLEST_FACTOR = 0.1


@dataclass(frozen=True)
class Spec:
    """One hidden effect; `low` and `high` is the driver's range, `unit` what amplitude 1 means at an additive sensor.

    At a process site and `level_sensor` the factor is 1 + amplitude (shape - centre), for `lag` and `delay` the
    amplitude is in seconds.
    """

    site: str
    driver: str
    shape: str
    amplitude: float = 0.0
    parameters: curves.Parameters = field(default_factory=dict)
    low: float = 0.0
    high: float = 1.0
    centre: float = 0.0
    unit: float = 1.0
    story: str = ""

    def number(self, name: str) -> float:
        """One scalar parameter."""
        value = self.parameters[name]
        assert isinstance(value, float)
        return value

    @property
    def in_equations(self) -> bool:
        """Whether it acts inside the differential equations (else on the measured values afterwards)."""
        return self.site not in SENSOR_SITES or self.site == "level_sensor"

    def static_curve(self) -> curves.Curve:
        """Shape of the raw driver."""
        numbers = {k: v for k, v in self.parameters.items() if isinstance(v, float)}
        shape, low, span = curves.STATIC[self.shape](numbers), self.low, self.high - self.low
        return lambda x: shape((x - low) / span)


def influence(spec: Spec, first: Sequence[float]) -> Influence:
    """Compile an effect that acts in the equations; first: the inputs at the start (for the states of an actuator)."""
    if spec.driver in ("lag", "delay"):
        if spec.amplitude == 0.0:
            return Influence(INDEX[spec.site], lambda t, s, own: 1.0)
        return _stiction(spec) if spec.shape == "stiction" else _cascade(spec, first)
    a, centre, site = spec.amplitude, spec.centre, INDEX[spec.site]
    additive = spec.site == "level_sensor" and spec.shape != "gain"

    def factor(s: float, level: float) -> float:
        return 1.0 + a * spec.unit * (s - centre) / level if additive else max(SMALLEST_FACTOR, 1.0 + a * (s - centre))

    if spec.driver == "constant":
        return Influence(site, lambda t, s, own: factor(1.0, s.level))
    if spec.driver == "time":
        curve = curves.temporal(spec.shape, spec.parameters)
        return Influence(site, lambda t, s, own: factor(curve(t), s.level))
    if spec.shape == "bistable":
        return _bistable(spec)
    static, at = spec.static_curve(), STATE_DRIVERS.index(spec.driver)
    if spec.driver == "grade":
        return Influence(
            site,
            lambda t, s, own: factor(static(own[0]), s.level),
            (0.2,),
            lambda t, s, own, grade: ((grade - own[0]) / GRADE_FOLLOWS,),
        )
    return Influence(site, lambda t, s, own: factor(static(s[at]), s.level))


def _bistable(spec: Spec) -> Influence:
    """A switch with two stable states between its thresholds: q' = (logistic(...z + w (2 q - 1)...) - q) / seconds."""
    at, a = STATE_DRIVERS.index(spec.driver), spec.amplitude
    middle, w, tau = spec.number("middle"), spec.number("half_width"), spec.number("seconds")

    def rates(t: float, s: Signals, own: Sequence[float], grade: float) -> tuple[float]:
        z = (s[at] - spec.low) / (spec.high - spec.low)
        target = curves.logistic((z - middle + w * (2.0 * own[0] - 1.0)) / 0.03)
        return ((target - own[0]) / tau,)

    return Influence(INDEX[spec.site], lambda t, s, own: 1.0 + a * (own[0] - spec.centre), (0.0,), rates)


def _cascade(spec: Spec, first: Sequence[float]) -> Influence:
    """Unequal lags in series (`lag`), or ten equal ones that add up to a dead time (`delay`): a flow or the level."""
    source = {"air_flow": 0, "feed_flow": 1, "level_sensor": 2, "tails_valve": 7}[spec.site]
    stages = 10 if spec.driver == "delay" else 2
    taus = [spec.amplitude / stages] * stages if spec.driver == "delay" else [spec.amplitude, 0.35 * spec.amplitude]
    start = first[source] if source < 3 else first[1]

    def rates(t: float, s: Signals, own: Sequence[float], grade: float) -> list[float]:
        values = (s[source], *own)
        return [(values[k] - values[k + 1]) / taus[k] for k in range(stages)]

    def multiplier(t: float, s: Signals, own: Sequence[float]) -> float:
        return 1.0 if s[source] != s[source] else own[-1] / s[source]

    return Influence(INDEX[spec.site], multiplier, (start,) * stages, rates)


def _stiction(spec: Spec) -> Influence:
    """A sticking valve: it stays until the flow asked differs by more than the band, then jumps to what is asked."""
    band = spec.amplitude * spec.unit

    def tick(t: float, s: Signals, memory: list[float]) -> None:
        if memory[0] < 0.0 or abs(s.tails_asked - memory[0]) > band:
            memory[0] = s.tails_asked

    def multiplier(t: float, s: Signals, own: Sequence[float]) -> float:
        return 1.0 if s.tails_asked != s.tails_asked or own[0] < 0.0 else own[0] / s.tails_asked

    return Influence(INDEX[spec.site], multiplier, (-1.0,), None, tick)
