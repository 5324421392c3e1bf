"""Servo-valve: spool dynamics and port flows. Two models behind one interface: command and supply in, spool out.

To add one: write its file (parameters, its number, kernels), add its row here, and its branch in
plant/integration.py.

And a valve by itself without load: the spool under a given command, both models; step and frequency responses.
Source: thesis figures 6.10, 6.11 (steps). Verified against the closed form of (3.19) and against each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.packing import record
from shake_ros.physics.valve import detailed
from shake_ros.physics.valve.detailed import VALVE_STATES, DetailedValve, carry_valve, valve_at_rest
from shake_ros.physics.valve.ports import no_load
from shake_ros.physics.valve.simplified import SimplifiedValve, limited_motion
from shake_ros.quantities import Parameters

VALVES: dict[str, type[Parameters]] = {"simplified": SimplifiedValve, "detailed": DetailedValve}
SMALL = 1e-3  # [-] amplitude of the frequency response of the linearised valve


@njit
def respond_detailed(p, commands, dt, p_s, p_t):
    """Spool position [-] of the detailed valve at the samples, from rest, under held commands."""
    y = valve_at_rest(p, p_s, p_t)
    k, stage = np.zeros((4, VALVE_STATES)), np.zeros(VALVE_STATES)
    spool = np.empty(commands.shape[0])
    for i in range(commands.shape[0]):
        spool[i] = y[detailed.SPOOL] / p.valve_spool_stroke
        carry_valve(p, y, commands[i], p_s, p_t, no_load(p_s, p_t), i * dt, dt, k, stage)
    return spool


@njit
def respond_simplified(p, commands, dt):
    """Spool position [-] of the simplified valve (3.19)–(3.22) at the samples, from rest, under held commands."""
    x, v = 0.0, 0.0
    friction, limit = p.valve_hysteresis, p.valve_rate_limit
    spool = np.empty(commands.shape[0])
    for i in range(commands.shape[0]):
        spool[i] = x
        wanted = min(max(p.valve_gain * commands[i], -1.0), 1.0)
        x, v = limited_motion(x, v, wanted, friction, p.valve_natural_frequency, p.valve_damping, limit, dt)
    return spool


def valve_response(
    valve: Parameters, commands: NDArray[np.float64], dt: float, supply: float, tank: float
) -> NDArray[np.float64]:
    """Spool position under commands held over samples.

    Parameters
    ----------
    valve : a member of VALVES.
    commands : shape (n,) [-].
    dt : [s].
    supply, tank : pressures [Pa].

    Returns
    -------
    shape (n,) [-]
    """
    p = record("valve", VALVES, valve)
    if isinstance(valve, DetailedValve):
        return np.asarray(respond_detailed(p, commands, dt, supply, tank))
    return np.asarray(respond_simplified(p, commands, dt))


def linear_response(valve: Any, frequencies: NDArray[np.float64], supply: float, tank: float) -> NDArray[np.complex128]:
    """Spool per command of the valve linearised at null, at the given frequencies [Hz], shape (n,), complex.

    The simplified valve's is ω²/(s² + 2Dω s + ω²); the detailed one's follows from its rates by central differences,
    with ball clearance, spool friction and dither, which have no linear form, left out.
    """
    s = 2j * np.pi * frequencies
    if not isinstance(valve, DetailedValve):
        omega, damping = valve.natural_frequency, valve.damping
        return np.asarray(valve.gain * omega**2 / (s**2 + 2.0 * damping * omega * s + omega**2))
    smooth = valve.replace(ball_clearance=0.0)
    matrix, column = linearised(smooth, supply, tank)
    identity = np.eye(len(matrix))
    gain = [np.linalg.solve(x * identity - matrix, column)[detailed.SPOOL - 1] for x in s]
    return np.array(gain, dtype=np.complex128) / float(valve.spool_stroke)


def linearised(valve: DetailedValve, supply: float, tank: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State matrix and input column of the detailed valve at null, without the coil's state: (7, 7) and (7,)."""
    p = record("valve", VALVES, valve.replace(coil_time=0.0))
    rest = valve_at_rest(p, supply, tank)
    steps = np.array([1.0, 1e-8, 1e-4, 1e2, 1e2, 1e2, 1e-7, 1e-4])

    def rates(y: NDArray[np.float64], u: float) -> NDArray[np.float64]:
        out = np.zeros(VALVE_STATES)
        detailed.valve_rates(p, y, u, supply, tank, no_load(supply, tank), out)
        return out[1:]

    columns = [
        (rates(rest + step * unit, 0.0) - rates(rest - step * unit, 0.0)) / (2.0 * step)
        for step, unit in zip(steps[1:], np.eye(VALVE_STATES)[1:], strict=True)
    ]
    return np.array(columns).T, (rates(rest, SMALL) - rates(rest, -SMALL)) / (2.0 * SMALL)
