"""A table that shares no code with shake_ros: equations, steps and noise of its own."""

import math

import numba
import numpy as np

SAMPLE, STEPS = 0.002, 40  # [s], integration steps per sample
AREA, HALF, MASS, MODULUS = 9.4562e-4, 1.2293e-4, 650.0, 8e8  # [m²], [m³], [kg], [Pa]
SUPPLY, TANK, FLOW, UNDERLAP = 206e5, 1e5, 1.81e-7, 0.005  # [Pa], [Pa], [m³/(s √Pa)], [-]


@numba.njit(cache=True)
def rates(y, u, dead_band):
    """Rates of position, velocity, both chamber pressures, spool and its speed."""
    x, v, a, b, s, r = y
    s = math.copysign(max(abs(s) - dead_band, 0.0), s)
    up, down = max(s + UNDERLAP, 0.0), max(UNDERLAP - s, 0.0)
    flow_a = FLOW * (up * math.sqrt(max(SUPPLY - a, 0.0)) - down * math.sqrt(max(a - TANK, 0.0)))
    flow_b = FLOW * (down * math.sqrt(max(SUPPLY - b, 0.0)) - up * math.sqrt(max(b - TANK, 0.0)))
    friction = (300.0 + 200.0 * math.exp(-30.0 * abs(v))) * math.tanh(v / 1e-3) + 400.0 * v
    rise_a = MODULUS / (HALF + AREA * x) * (flow_a - AREA * v - 1e-12 * (a - b))
    rise_b = MODULUS / (HALF - AREA * x) * (flow_b + AREA * v + 1e-12 * (a - b))
    force = AREA * (a - b) - friction
    return np.array([v, force / MASS, rise_a, rise_b, r, 2.56e6 * (u - y[4]) - 2355.2 * r])


@numba.njit(cache=True)
def measured(command, noise, dead_band=0.0):
    """Position [m] and acceleration [m/s²] under a command, with `noise` of shape (2, n) in standard deviations."""
    y, dt = np.array([0.0, 0.0, SUPPLY / 2, SUPPLY / 2, 0.0, 0.0]), SAMPLE / STEPS
    x, a = 2e-5 * noise[0], 0.2 * noise[1]
    for k, u in enumerate(command):
        x[k] += y[0]
        a[k] += rates(y, u, dead_band)[1]
        for _ in range(STEPS):
            y += dt * rates(y + 0.5 * dt * rates(y, u, dead_band), u, dead_band)
    return x, a
