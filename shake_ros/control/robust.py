"""Observer and controllers for one table, sound on its neighbours: the linear part.

Neighbours are draws of the table's uncertain parameters under other loads and supply pressures. Each is linearised at
points over its operating range (places of the stroke, speeds, and load pressures within and beyond a soft zone), with
further dead time; the observer carries the table itself. For every observer and every damping of the oil column by the
acceleration the largest bandwidth is sought at which the sensitivity |1/(1 + L)| stays below its bound on all of them.

A valve damps the oil column by K_c = dq/dP, which grows with its opening, and friction that falls with speed takes
damping away: the column of a table with little leakage is well damped at 0.1 m/s and hardly at all in slow motion. The
nonlinear loop passes there at each reversal. A design that is `calm` holds in slow motion as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.linear_loop import (
    Feedback,
    Held,
    Margins,
    OpenLoop,
    grid,
    linear_at,
    margins,
    open_loop,
    sensitivity,
)
from shake_ros.control.observer.linear import LinearObserver, kalman_gain
from shake_ros.physics.plant.linearisation import LinearModel, linearise, operating_point
from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.physics.plant.reduced import ReducedParameters
from shake_ros.physics.plant.simulation import initial_state
from shake_ros.physics.plant.states import PRESSURE_A, PRESSURE_B, SPOOL, VELOCITY
from shake_ros.quantities import Parameters, ShakeError, quantity

Array = NDArray[np.float64]
JERKS = (0.1, 0.3, 1.0, 3.0)  # [m/s^2.5] white jerk of the observers that are tried
SLOW_TRANSDUCER, SLOWER = 2e-3, 0.1  # [s] lag of the position from which every jerk is so much less: quick ones ring
WANDER = 60.0  # [1/s] density of the disturbance over that of the jerk
DAMPINGS = (0.0, 0.15, 0.3, 0.6)  # damping ratios that the acceleration adds to the oil column, of those that are tried
INTEGRAL = 8.0  # the integral acts below the bandwidth over this
SLOWEST = 0.02  # of the largest bandwidth: the smallest that is tried
HALVINGS = 6  # of the bandwidth's interval
HARDEST = 10  # linear models on which a bandwidth is sought; it is then held against all
SLOW = 0.2  # of the speed of the linear models: slow motion
CALM_DAMPING, CALM_JERK = 0.8, 0.3  # of the design that shakes the least
QUICK_DAMPING, QUICK_JERK = 0.15, 1.0  # of one that damps a little, without delay: an oil column that others excite
LOWEST_COLUMN, HIGHEST_COLUMN = 10.0, 900.0  # [rad/s] between which the oil column is sought
OSCILLATING = 0.5  # damping ratio below which a pair of poles counts as the oil column


@dataclass(frozen=True)
class RobustSettings(Parameters):
    """What gains must hold against, and how well; `numbers` of config/robust_tuning."""

    sample_time: float = quantity("s", "sample time", low=1e-5, high=0.1)
    loop_delay: float = quantity("s", "dead time of the loop beyond the table's", low=0.0, high=0.1)
    further_delay: int = quantity("-", "samples by which it may be longer", low=0, high=20)
    supply: float = quantity("-", "relative change of the supply pressure", low=0.0, high=0.5)
    modulus: float = quantity("-", "relative standard error of the bulk modulus without one", low=0.0, high=1.0)
    flow: float = quantity("-", "relative standard error of the flow coefficient without one", low=0.0, high=1.0)
    tables: int = quantity("-", "neighbours of the table", low=1, high=1000)
    seed: int = quantity("-", "of the draws", low=0, high=2**31)
    position: float = quantity("m", "range of the stroke to each side", low=0.0, high=10.0)
    velocity: float = quantity("m/s", "speed of the linear models", low=1e-3, high=10.0)
    load_pressure: float = quantity("Pa", "load pressure of the linear models, besides zero", low=0.0, high=1e8)
    position_noise: float = quantity("m", "standard deviation of a position sample", low=1e-9, high=0.01)
    model_bandwidth: float = quantity("rad/s", "bandwidth of the virtual table's control", low=1.0, high=2000.0)
    model_horizon: float = quantity("s", "shortest horizon of the virtual table's control", low=1e-4, high=0.1)
    sensitivity: float = quantity("-", "largest |1/(1 + L)|", low=1.1, high=5.0)
    ringing: float = quantity("-", "largest ringing, see metrics.ringing", low=0.0, high=10.0)
    fastest: float = quantity("rad/s", "largest bandwidth of the position", low=0.1, high=1000.0)
    model_rate: float = quantity("1/s", "largest rate of the virtual table's command", low=1.0, high=1e5, default=150.0)
    jump: float = quantity("-", "change of the command in a sample that is reported", low=0.0, high=2.0, default=0.3)


class Uncertainty(NamedTuple):
    """Fitted parameters by dotted name, and their covariance (p, p) in their units."""

    names: tuple[str, ...]
    covariance: Array


class Load(NamedTuple):
    """A specimen [kg]; with a frequency [Hz] it stands on a spring, with this damping ratio."""

    mass: float
    frequency: float = 0.0
    damping: float = 0.03

    @property
    def values(self) -> dict[str, float]:
        """Of a table, by dotted name."""
        found = {"body.specimen_mass": self.mass}
        if self.frequency > 0.0:
            own = {"mass": self.mass, "frequency": self.frequency, "damping": self.damping}
            found |= {f"effects.specimen_resonance.{name}": value for name, value in own.items()}
        return found


class LinearCase(NamedTuple):
    """A linear model of a neighbour, and the one that the observer carries there."""

    plant: Held
    model: Held


class Design(NamedTuple):
    """A state feedback with its observer, and the bandwidth [rad/s] and damping that they were made for."""

    feedback: Feedback
    observer: LinearObserver
    bandwidth: float
    damping: float
    jerk: float


def uncertainty_of(table: TableParameters, s: RobustSettings) -> Uncertainty:
    """What is taken for a table that comes without its uncertainty."""
    spread = {f"bulk_modulus.{name}": s.modulus * value for name, value in table.bulk_modulus.scaled(1.0).items()}
    spread["valve.flow_coefficient"] = s.flow * table.value("valve.flow_coefficient")
    return Uncertainty(tuple(spread), np.diag(np.square(list(spread.values()))))


def drawn(table: TableParameters, known: Uncertainty, rng: np.random.Generator) -> dict[str, float]:
    """A draw of the uncertain parameters, within their bounds."""
    size = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))  # units differ by many orders of magnitude
    spread = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(known.covariance / spread / spread[:, None])
    change = size * (vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(values))))
    found = {}
    for name, step in zip(known.names, np.clip(change, -1e12, 1e12), strict=True):
        data = FIELDS[name].metadata
        found[name] = float(np.clip(table.value(name) + step, data["low"], data["high"]))
    return found


def neighbours(
    table: TableParameters, known: Uncertainty, loads: Sequence[Load], s: RobustSettings
) -> list[TableParameters]:
    """The table, then draws of it: under its own specimen and the loads in turn, with supply low and high in turn.

    A specimen of the table itself that is found to be flexible stays flexible under the loads that are rigid.
    """
    rng = np.random.default_rng(s.seed)
    others = itertools.cycle((*(load.values for load in loads), {}))
    supplies = itertools.cycle((1.0 - s.supply, 1.0 + s.supply))
    supply = table.value("supply.supply_pressure")
    found = [table]
    while len(found) < s.tables:
        values = drawn(table, known, rng) | next(others)
        found.append(table.with_values(values | {"supply.supply_pressure": supply * next(supplies)}))
    return found


def points(table: TableParameters, s: RobustSettings) -> list[Array]:
    """States over the operating range; where none is steady, the table moves with its pressures in the middle."""
    reach = min(s.position, 0.4 * table.body.stroke)
    wanted = [(0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (reach, 1.0, 0.0), (-reach, -1.0, 0.0), (0.0, 3.0, 0.0)]
    found = []
    for x, speed, loaded in wanted:
        try:
            y = operating_point(table, x, speed * s.velocity)
        except ShakeError:
            y = initial_state(table.vector(), x)
            y[VELOCITY], y[SPOOL] = speed * s.velocity, 2.0 * speed * s.velocity
        y[PRESSURE_A] += 0.5 * loaded * s.load_pressure
        y[PRESSURE_B] -= 0.5 * loaded * s.load_pressure
        found.append(y)
    return found


def oil_column(model: LinearModel) -> tuple[float, float]:
    """Frequency [rad/s] and damping ratio of the fastest pair of poles that oscillates; a specimen's is slower.

    Where leakage damps it so much that none does, those of velocity and load pressure alone.
    """
    pairs = [p for p in model.poles() if p.imag > 0.0 and LOWEST_COLUMN < abs(p) < HIGHEST_COLUMN]
    pairs = [p for p in pairs if -p.real < OSCILLATING * abs(p)]
    if pairs:
        fast = max(pairs, key=abs)
        return float(abs(fast)), float(-fast.real / abs(fast))
    a = model.a[np.ix_(*2 * [[model.states.index(i) for i in (VELOCITY, PRESSURE_A, PRESSURE_B)]])]
    into, out = np.array([[1.0, 0.0], [0.0, 0.5], [0.0, -0.5]]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0]])
    alone = out @ a @ into
    square = float(np.linalg.det(alone))
    if not square > LOWEST_COLUMN**2:
        raise ShakeError("the table has no oil column to design for: its load pressure does not answer to its velocity")
    return math.sqrt(square), float(-np.trace(alone)) / (2.0 * math.sqrt(square))


def softest(table: TableParameters, states: Sequence[Array]) -> ReducedParameters:
    """β of the reduced model at the point where the oil column is softest."""
    models = [linearise(table, y) for y in states]
    frequency, damping = min((oil_column(m) for m in models), key=lambda pair: pair[0])
    gain = float(np.median([abs(m.response("velocity", np.array([0.5]))[0]) for m in models]))
    return ReducedParameters(
        beta1=-(frequency**2), beta2=-2.0 * damping * frequency, beta3=gain * frequency**2, beta4=0.0, beta5=0.0
    )


def cases(
    tables: Sequence[TableParameters],
    s: RobustSettings,
    states: Callable[[TableParameters, RobustSettings], list[Array]],
) -> list[LinearCase]:
    """Linear models of the neighbours at some states, with further dead time; the first table is the one carried."""
    carried = [linear_at(tables[0], y, s.loop_delay, s.sample_time) for y in states(tables[0], s)]
    found = []
    for table in tables:
        for further in range(s.further_delay + 1):
            late = s.loop_delay + further * s.sample_time
            plants = [linear_at(table, y, late, s.sample_time) for y in states(table, s)]
            found += [LinearCase(plant, model) for plant, model in zip(plants, carried, strict=False)]
    return found


def slow_motion(table: TableParameters, s: RobustSettings) -> list[Array]:
    """A state in slow motion; none where the table does not move steadily there."""
    try:
        return [operating_point(table, 0.0, SLOW * s.velocity)]
    except ShakeError:
        return []


def observer_of(beta: ReducedParameters, jerk: float, s: RobustSettings) -> LinearObserver:
    """The observer whose gain belongs to a white jerk."""
    noise = {"position_noise": s.position_noise, "jerk_noise": jerk, "disturbance_noise": WANDER * jerk}
    return LinearObserver(**vars(beta), **noise)


class Search:
    """The search for bandwidths on the linear models of a table's neighbours."""

    def __init__(self, tables: Sequence[TableParameters], s: RobustSettings) -> None:
        self.s, self.tables = s, tables
        self.beta = softest(tables[0], points(tables[0], s))
        self.cases = cases(tables, s, points)
        self.slow = cases(tables, s, slow_motion)
        mass = tables[0].moved_mass + tables[0].value("effects.payload_error.mass")
        self._per_acceleration = mass / tables[0].body.acting_area
        self.slowest = SLOWEST * s.fastest
        lag = tables[0].value("effects.position_sensor_lag.time_constant")
        self._per_jerk = SLOWER if lag > SLOW_TRANSDUCER else 1.0
        self._omega = grid(s.sample_time, 120)

    def feedback(self, bandwidth: float, damping: float) -> Feedback:
        """The state feedback of a bandwidth [rad/s] that adds a damping ratio to the oil column."""
        b = self.beta
        position = -bandwidth * b.beta1 / b.beta3
        return Feedback(
            position * bandwidth / INTEGRAL, position, 0.0, 2.0 * damping * math.sqrt(-b.beta1) / b.beta3
        )  # fmt: skip

    def worst(self, design: Design, chosen: Sequence[LinearCase]) -> list[float]:
        """The sensitivity on each linear model."""
        gains = kalman_gain(design.observer, self.s.sample_time)
        return [sensitivity(self._loop(design, case, gains), self._omega) for case in chosen]

    def margins(self, design: Design) -> Margins:
        """The margins on the linear model where the sensitivity is largest."""
        at = int(np.argmax(self.worst(design, self.cases)))
        return margins(self._loop(design, self.cases[at], kalman_gain(design.observer, self.s.sample_time)))

    def _loop(self, design: Design, case: LinearCase, gains: Array) -> OpenLoop:
        return open_loop(case.plant, case.model, gains, self._per_acceleration, design.feedback, self.s.sample_time)

    def design(self, bandwidth: float, damping: float, jerk: float) -> Design:
        """A design as it is asked for; behind a slow transducer its observer takes the jerk for less."""
        observer = observer_of(self.beta, self._per_jerk * jerk, self.s)
        return Design(self.feedback(bandwidth, damping), observer, bandwidth, damping, jerk)

    def fastest(self, damping: float, jerk: float, hardest: Sequence[LinearCase]) -> Design | None:
        """The design of the largest bandwidth that holds on these linear models; None where none does."""
        low, high = self.slowest, self.s.fastest

        def holds(bandwidth: float) -> bool:
            return max(self.worst(self.design(bandwidth, damping, jerk), hardest)) <= self.s.sensitivity

        if not holds(low):
            return None
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if holds(middle) else (low, middle)
        return self.design(low, damping, jerk)

    def best(
        self, dampings: Sequence[float], jerks: Sequence[float] = JERKS, slow: Sequence[LinearCase] = ()
    ) -> Design | None:
        """The fastest design over these dampings and observers that holds on all linear models, and on `slow` ones."""
        cases = [*self.cases, *slow]
        middle = self.design(0.2 * self.s.fastest, max(dampings) / 2.0, JERKS[1])
        order = np.argsort([-value for value in self.worst(middle, cases)])
        hardest = [cases[i] for i in order[:HARDEST]]
        tried = (self.fastest(damping, jerk, hardest) for damping in dampings for jerk in jerks)
        found = sorted((d for d in tried if d), key=lambda d: -d.bandwidth)
        for design in found[:2]:
            while design.bandwidth > self.slowest:
                if max(self.worst(design, cases)) <= self.s.sensitivity:
                    return design
                design = self.design(0.8 * design.bandwidth, design.damping, design.jerk)
        return None

    def calm(self, dampings: Sequence[float]) -> list[Design]:
        """What to fall back on where the fastest design rings: well damped and holding in slow motion too.

        Where no such design holds: one that holds in slow motion as it can, and one that is well damped. Beside them
        one that damps little through a quick observer, which quietens what a wrong load or a swaying specimen excites.
        A law without a gain of the acceleration has no damping to give.
        """
        as_it_can = self.best(dampings, slow=self.slow)
        if max(dampings) == 0.0:
            return [as_it_can] if as_it_can else []
        both = self.best([CALM_DAMPING], [CALM_JERK], self.slow)
        found = [both] if both else [as_it_can, self.best([CALM_DAMPING], [CALM_JERK])]
        return [design for design in (*found, self.best([QUICK_DAMPING], [QUICK_JERK])) if design]
