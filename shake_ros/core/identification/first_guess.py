"""A first guess of a table from recordings alone: where a fit of the full physics begins.

Velocity gain, hydraulic frequency, damping and delay are those of the linear table

    K e^(−jωτ) / (1 + 2ζ jω/ω_h − ω²/ω_h²)

that comes nearest to the measured response from command to velocity where it is coherent. Dry friction and the
acceleration at which the valve has no pressure left do not show there: of a small grid of both the one whose free run
leaves least is taken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shake_ros.core.analysis.frequency_response import SHORTEST, frequency_response
from shake_ros.core.identification.nuisances import slow
from shake_ros.core.identification.recordings import DeclaredModel, Record, RecordingProblem, windows
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError

WINDOW = 4.0  # of the response [s]
LOWEST, HIGHEST = 0.7, 60.0  # lines that are looked at [Hz]
COHERENT = 0.5  # lines below are left out
MOST = 0.7  # share of the lines up to a frequency that is seen
DAMPINGS = np.geomspace(0.02, 1.0, 14)
RESERVES = (1.2, 1.7, 3.0)  # acceleration at full pressure, in parts of the largest measured one
FRICTIONS = (0.05, 0.3, 1.0)  # dry friction per mass [m/s²]
FREE_STROKE = 4.0  # length of both chambers in parts of the range of motion, where nothing is known
PIECES = 15.0  # of the recordings that the grid is run over [s]


@dataclass(frozen=True)
class LinearTable:
    """Velocity gain [m/s per command], delay [s], hydraulic frequency [rad/s], damping [-].

    seen_to : frequency up to which most lines are coherent [rad/s]; a hydraulic frequency beyond it is only a guess.
    """

    gain: float
    delay: float
    omega: float
    damping: float
    seen_to: float


def linear_table(records: Sequence[Record]) -> LinearTable:
    """The linear table nearest to the measured response, weighted with its coherence.

    Raises
    ------
    ShakeError : the motion does not follow the command, or goes against it.
    """
    lines, values, weights, looked = [], [], [], []
    for record in records:
        seconds = len(record.commands) * record.sample_time
        window = max(min(WINDOW, 0.4 * seconds), SHORTEST * record.sample_time)
        found = frequency_response(record.commands, record.position, record.sample_time, window)
        f = found.frequency
        within = (f >= LOWEST) & (f <= min(HIGHEST, 0.35 / record.sample_time))
        use = within & (found.coherence > COHERENT)
        looked.append(np.column_stack([2.0 * math.pi * f[within], use[within]]))
        lines.append(2.0 * math.pi * f[use])
        values.append(2j * math.pi * f[use] * found.response[use])
        weights.append(found.coherence[use] / (1.05 - found.coherence[use]))
    omega, response, weight = (np.concatenate(x) for x in (lines, values, weights))
    names = ", ".join(dict.fromkeys(r.name for r in records))
    if len(omega) < 5:
        raise ShakeError(f"{names}: the position does not follow the command (no coherent frequency)")
    weight = weight / np.sum(weight)
    seen = _seen_to(np.concatenate(looked))
    gain = slow_gain(records)
    if gain <= 0.0:
        raise ShakeError(f"{names}: the velocity goes against the command; import one of them with the scale -1")
    best, least = None, math.inf
    shape = np.log(response / gain)
    shape = shape.real + 1j * np.angle(response)
    for f, z in itertools.product(np.geomspace(2.0, HIGHEST, 60), DAMPINGS):
        w = 2.0 * math.pi * f
        model = -np.log(1.0 - (omega / w) ** 2 + 2j * z * omega / w)
        left = (shape - model).imag
        left = np.angle(np.exp(1j * left))
        delay = float(np.clip(-np.sum(weight * omega * left) / np.sum(weight * omega**2), 0.0, 0.05))
        phase = np.angle(np.exp(1j * (left + omega * delay)))
        size = (shape - model).real
        offset = float(np.sum(weight * size))
        cost = float(np.sum(weight * (np.abs(size - offset) + np.abs(phase) + 0.3 * abs(offset))))
        if cost < least:
            best = LinearTable(gain * math.exp(offset), delay, float(w), float(z), seen)
            least = cost
    assert best is not None
    return best


def _seen_to(lines: np.ndarray) -> float:
    """Frequency up to which most lines are coherent; lines : (frequency, whether coherent), shape (m, 2)."""
    order = np.argsort(lines[:, 0])
    share = np.cumsum(lines[order, 1]) / np.arange(1, len(order) + 1)
    most = np.flatnonzero(share >= MOST)
    return float(lines[order[most[-1]], 0]) if len(most) else 0.0


def slow_gain(records: Sequence[Record]) -> float:
    """Velocity per command of the slow motion [m/s]."""
    cross = power = 0.0
    for record in records:
        u, v = (slow(x, record.sample_time)[record.start :] for x in (record.commands, record.velocity))
        cross += float((u - u.mean()) @ (v - v.mean())) * record.sample_time
        power += float((u - u.mean()) @ (u - u.mean())) * record.sample_time
    return cross / max(power, 1e-300)


class FirstGuess:
    """Linear table and range of motion of the recordings, from which tables are made in any gauge."""

    def __init__(self, records: Sequence[Record]) -> None:
        self.records = list(records)
        self.linear = linear_table(records)
        self.reach = max(float(np.max(np.abs(r.position))) for r in records)
        self.largest = max(float(np.percentile(np.abs(self._acceleration(r)), 99.9)) for r in records)

    def _acceleration(self, record: Record) -> np.ndarray:
        if record.acceleration is not None:
            return record.acceleration
        return np.asarray(np.gradient(record.velocity, record.sample_time))

    def tables(self, given: TableParameters, unknown: Sequence[str], model: DeclaredModel) -> list[TableParameters]:
        """The given table with guesses of what is unknown, the best first."""
        problem = RecordingProblem(windows(self.records, PIECES), model)
        tables = [self._made(given, unknown, r, f) for r, f in itertools.product(RESERVES, FRICTIONS)]
        rows = problem.residuals(np.array([t.vector() for t in tables]))
        costs = np.mean(np.nan_to_num(rows, nan=1e3, posinf=1e3, neginf=-1e3) ** 2, axis=1)
        return [tables[i] for i in np.argsort(costs)]

    def _made(self, given: TableParameters, unknown: Sequence[str], reserve: float, friction: float) -> TableParameters:
        area, drop = given.body.piston_area, given.supply.supply_pressure - given.supply.tank_pressure

        def of(name: str, guess: float) -> float:
            field = given.fields[name].metadata
            return float(np.clip(guess, field["low"], field["high"])) if name in unknown else given.value(name)

        mass = of("body.table_mass", drop * area / (reserve * self.largest)) + given.body.specimen_mass
        volume = of("body.cylinder_volume", 2.0 * FREE_STROKE * self.reach * area)
        modulus = of("bulk_modulus.modulus", self.linear.omega**2 * volume * mass / (4.0 * area**2))
        stiff = math.sqrt(modulus * mass / volume) / area
        values = {
            "body.table_mass": mass - given.body.specimen_mass,
            "body.cylinder_volume": volume,
            "bulk_modulus.modulus": modulus,
            "valve.flow_coefficient": self.linear.gain * area / math.sqrt(0.5 * drop),
            "leakage.internal": 0.3 * self.linear.damping / stiff,
            "friction.coulomb_level": friction * mass,
            "friction.stribeck_rise": 0.3 * friction * mass,
            "friction.viscous": 0.5 * mass,
            "effects.command_delay.delay": 0.5 * self.linear.delay,
        }
        guessed = {name: of(name, value) for name, value in values.items() if name in unknown}
        return given.with_values(guessed)
