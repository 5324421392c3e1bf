"""Numerical linearisation of the table at an operating point: ẏ = A y + B u, outputs position, velocity, acceleration.

Central differences of the one right-hand side, so every effect takes part; states that these parameters do not set in
motion are left out. An operating point is a position and a steady velocity with the pressures and the spool opening
that keep both: a = 0 and Ṗ_A = Ṗ_B = 0. Hysteresis, dead time and the contact states of dynamic friction have no
derivative there: they are held, and u acts without the width of its backlash. Backlash between rod and table is closed,
the rod in contact: within it nothing moves the table.

Verified against: the oil spring (2.25), (2.36) over the stroke; the spool's (3.19); the reduced model; small sines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig
from scipy.optimize import root

from shake_ros.physics.bulk_modulus import moduli
from shake_ros.physics.bulk_modulus.stiffness import natural_frequency
from shake_ros.physics.effects.structure import has_backlash
from shake_ros.physics.plant.cylinder import Sides, oil_spring, rest_pressures
from shake_ros.physics.plant.parameters import INDEX, TableParameters, records
from shake_ros.physics.plant.right_hand_side import active_states, right_hand_side
from shake_ros.physics.plant.simulation import initial_state
from shake_ros.physics.plant.states import (
    CONTINUOUS,
    POSITION,
    PRESSURE_A,
    PRESSURE_B,
    PRESSURE_SUPPLY,
    ROD,
    SPOOL,
    SPOOL_RATE,
    STATES,
    VELOCITY,
)
from shake_ros.quantities import ShakeError

Matrix = NDArray[np.float64]
OUTPUTS = ("position", "velocity", "acceleration")
GAP = "effects.coupling_backlash.gap"
CLOSED = 1e-4  # [m] beyond half the gap, at which backlash is closed: more than the step of the differences
STEP = 1e-5  # of the differences, relative to the typical size of each state
LARGEST_ZERO = 1e5  # [rad/s] zeros beyond it are those at infinity, moved by rounding


def state_scales() -> Matrix:
    """A typical size of each continuous state, in its unit."""
    scales = np.ones(CONTINUOUS)
    scales[[POSITION, VELOCITY, SPOOL, SPOOL_RATE]] = 1e-2, 1e-2, 1e-2, 10.0
    scales[[PRESSURE_A, PRESSURE_B, PRESSURE_SUPPLY]] = 1e6
    return scales


@dataclass(frozen=True)
class LinearModel:
    """ẏ = A y + B u, (position, velocity, acceleration) = C y + D u about an operating point."""

    states: tuple[int, ...]  # indices of plant/states.py, shape (m,)
    a: Matrix  # (m, m)
    b: Matrix  # (m,)
    c: Matrix  # (3, m)
    d: Matrix  # (3,)

    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, by size [rad/s]."""
        values: NDArray[np.complex128] = np.linalg.eigvals(balanced(self)[0]).astype(complex)
        return values[np.argsort(np.abs(values))]

    def zeros(self, output: str) -> NDArray[np.complex128]:
        """Finite transmission zeros from u to an output, by size [rad/s]."""
        row = _output(output)
        a, b, c = balanced(self)
        m = len(a)
        system = np.block([[a, b[:, None]], [c[row][None, :], np.full((1, 1), self.d[row])]])
        values = eig(system, np.diag([1.0] * m + [0.0]), right=False)
        finite: NDArray[np.complex128] = values[np.isfinite(values) & (np.abs(values) < LARGEST_ZERO)]
        return finite[np.argsort(np.abs(finite))]

    def response(self, output: str, frequency: Matrix) -> NDArray[np.complex128]:
        """Output per command at frequencies of shape (n,) [Hz]; complex, shape (n,)."""
        row = _output(output)
        a, b, c = balanced(self)
        unit = np.eye(len(a))
        return np.array(
            [c[row] @ np.linalg.solve(2j * np.pi * f * unit - a, b) + self.d[row] for f in np.ravel(frequency)]
        )


def _output(name: str) -> int:
    if name not in OUTPUTS:
        raise ShakeError(f"output '{name}' is none of {', '.join(OUTPUTS)}")
    return OUTPUTS.index(name)


def balanced(model: LinearModel) -> tuple[Matrix, Matrix, Matrix]:
    """A, B, C in states divided by their typical size: pressures and positions differ by eight powers of ten."""
    s = state_scales()[list(model.states)]
    return model.a * s / s[:, None], model.b / s, model.c * s


def operating_point(parameters: TableParameters, position: float = 0.0, velocity: float = 0.0) -> Matrix:
    """State at a position [m] with a steady velocity [m/s]: no acceleration and no change of the pressures.

    Raises ShakeError where no opening of the valve gives this velocity.
    """
    vector = parameters.with_values({GAP: 0.0}).vector()  # no force passes where nothing accelerates
    record = records(vector)[0]
    y = initial_state(vector, position)
    y[VELOCITY] = velocity
    rates, n = np.zeros(CONTINUOUS), active_states(record)
    y[PRESSURE_SUPPLY] = vector[INDEX["supply.supply_pressure"]]

    def residual(unknown: Matrix) -> Matrix:
        y[PRESSURE_A], y[PRESSURE_B], y[SPOOL] = unknown[0] * 1e6, unknown[1] * 1e6, unknown[2]
        acceleration = right_hand_side(record, y, y, y[SPOOL], 0.0, n, rates)
        return np.array([rates[PRESSURE_A] * 1e-8, rates[PRESSURE_B] * 1e-8, acceleration])

    largest = np.sign(velocity) * min(1.0, 0.05 + 1.3 * abs(velocity))
    found = root(residual, [y[PRESSURE_A] * 1e-6, y[PRESSURE_B] * 1e-6, 0.5 * largest], tol=1e-12)
    remaining = residual(found.x)
    if np.max(np.abs(remaining)) > 1e-6 or abs(y[SPOOL]) > 1.0:
        raise ShakeError(f"no opening of the valve keeps {velocity:g} m/s at position {position:g} m")
    return y


def linearise(parameters: TableParameters, state: Matrix | None = None) -> LinearModel:
    """Linear model at a state of shape (STATES,), the table at rest in mid-stroke where not given."""
    y0 = operating_point(parameters) if state is None else np.array(state[:STATES])
    vector = parameters.vector()
    record = records(vector)[0]
    n, scales = active_states(record), state_scales()
    gain = float(vector[INDEX["valve.gain"]])
    if has_backlash(parameters.value(GAP)):
        y0[ROD] = 0.5 * parameters.value(GAP) + CLOSED

    def evaluate(y: Matrix, wanted: float) -> Matrix:
        rates = np.zeros(CONTINUOUS)
        acceleration = right_hand_side(record, y, y, wanted, 0.0, n, rates)
        return np.append(rates[:n], acceleration)

    def slope(index: int) -> Matrix:
        ahead, back, h = y0.copy(), y0.copy(), STEP * scales[index]
        ahead[index] += h
        back[index] -= h
        return (evaluate(ahead, y0[SPOOL]) - evaluate(back, y0[SPOOL])) / (2.0 * h)

    jacobian = np.array([slope(i) for i in range(n)]).T
    by_command = gain * (evaluate(y0, y0[SPOOL] + STEP) - evaluate(y0, y0[SPOOL] - STEP)) / (2.0 * STEP)
    moving = [i for i in range(n) if np.any(jacobian[i] != 0.0)]
    c = np.zeros((3, len(moving)))
    c[0, moving.index(POSITION)] = 1.0
    c[1, moving.index(VELOCITY)] = 1.0
    c[2] = jacobian[n, moving]
    d = np.array([0.0, 0.0, by_command[n]])
    return LinearModel(tuple(moving), jacobian[np.ix_(moving, moving)], by_command[moving], c, d)


def oil_column_frequency(parameters: TableParameters, position: float = 0.0) -> float:
    """ω = sqrt(k/M), k = E_A A_A²/V_A + E_B A_B²/V_B, the closed form of (2.25), (2.36) for a table at rest [rad/s].

    E is that of the table's law at the pressures of rest, without effects on the oil.
    """
    supply = parameters.supply
    pressures = rest_pressures(supply.supply_pressure, supply.tank_pressure, parameters.body.area_ratio)
    e_a, e_b = (float(e) for e in moduli(parameters.bulk_modulus, np.array(pressures)))
    k = oil_spring(parameters, Sides(e_a, e_b), position)
    return float(natural_frequency(k, parameters.moved_mass + parameters.value("effects.payload_error.mass")))
