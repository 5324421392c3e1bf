"""The declared table written a second time, from the equation sheet alone, for comparison with shake_ros.physics.plant.

Six states (6.2): x [m], v [m/s], P_A, P_B [Pa], x_s* [-], ẋ_s* [1/s]; the two sides of the cylinder may differ (3.23).
Plain floats and math only, so that the same functions serve scipy's Radau as they stand and, compiled, a Runge–Kutta of
very small steps. Nothing here imports the package; the numbers come from the table's YAML file.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from math import exp, tanh
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import yaml
from scipy.integrate import Radau
from scipy.linalg import expm

from benchmarks import ROOT

BERGAMO = ROOT / "config" / "table" / "bergamo.yaml"
SCALES = np.array([1e-2, 0.1, 1e6, 1e6, 0.1, 100.0])  # a typical size of each state, for absolute tolerances


class Constants(NamedTuple):
    """Constants of (6.3)–(6.20), SI."""

    area: float
    half_volume: float
    mass: float
    half_stroke: float
    stop_stiffness: float
    stop_damping: float
    supply: float
    tank: float
    omega: float
    damping: float
    rate_limit: float
    friction: float  # f_hs, dry friction on the spool
    flow: float
    underlap: float
    laminar: float
    modulus: float
    coulomb: float
    rise: float
    decay: float
    viscous: float
    sharp: float
    internal: float
    external: float
    lambda_1: float  # (6.20), in parts of the declared modulus
    lambda_2: float
    mu: float
    edge: float
    area_b: float  # of chamber B, (3.23)
    half_volume_b: float  # of chamber B at mid-stroke, (3.24)


def constants(soft_zone_depth: float = 0.0, path: Path = BERGAMO, **changes: float) -> Constants:
    """Constants of the table's file, with the soft zone of (6.20) and single values changed.

    The soft zone is given by its depth d at zero load pressure, λ_2/λ_1 = d / (2 tanh(μ P_Lt)), with table 6.9.
    """
    tree: dict[str, dict[str, Any]] = yaml.safe_load(path.read_text(encoding="utf-8"))
    file = {section: {key: float(value) for key, value in content.items()} for section, content in tree.items()}
    body, valve, friction = file["body"], file["valve"], file["friction"]
    mu, edge = 8.8e-6, 9.177e5
    table = Constants(
        area=body["piston_area"],
        half_volume=0.5 * body["cylinder_volume"],
        mass=body["table_mass"] + body["specimen_mass"],
        half_stroke=0.5 * body["stroke"],
        stop_stiffness=body["end_stop_stiffness"],
        stop_damping=body["end_stop_damping"],
        supply=file["supply"]["supply_pressure"],
        tank=file["supply"]["tank_pressure"],
        omega=valve["natural_frequency"],
        damping=valve["damping"],
        rate_limit=valve["rate_limit"],
        friction=valve["hysteresis"],
        flow=valve["flow_coefficient"],
        underlap=valve["underlap"],
        laminar=valve["laminar_pressure"],
        modulus=file["bulk_modulus"]["modulus"],
        coulomb=friction["coulomb_level"],
        rise=friction["stribeck_rise"],
        decay=friction["stribeck_decay"],
        viscous=friction["viscous"],
        sharp=friction["transition_velocity"],
        internal=file["leakage"]["internal"],
        external=file["leakage"]["external"],
        lambda_1=1.0,
        lambda_2=0.5 * soft_zone_depth / tanh(mu * edge),
        mu=mu,
        edge=edge,
        area_b=body["piston_area"],
        half_volume_b=0.5 * body["cylinder_volume"],
    )
    return table._replace(**changes)


def edge_flow(opening: float, drop: float, laminar: float) -> float:
    """g · sroot(Δp) with the laminar stretch below `laminar` [√Pa]."""
    gap = opening
    if gap <= 0.0:
        return 0.0
    if gap > 1.0:
        gap = 1.0
    return gap * drop * (drop * drop + laminar * laminar) ** -0.25


def rates(y: Any, wanted: float, c: Any) -> tuple[float, float, float, float, float, float]:
    """Time derivatives (6.3)–(6.14), (3.19) of the six states at a spool command `wanted`."""
    x, v, p_a, p_b, s, ds = y[0], y[1], y[2], y[3], y[4], y[5]
    q_a = c.flow * (
        edge_flow(s + c.underlap, c.supply - p_a, c.laminar) - edge_flow(c.underlap - s, p_a - c.tank, c.laminar)
    )
    q_b = c.flow * (
        edge_flow(s + c.underlap, p_b - c.tank, c.laminar) - edge_flow(c.underlap - s, c.supply - p_b, c.laminar)
    )
    load = p_a - p_b * c.area_b / c.area
    stiffness = c.modulus * (c.lambda_1 - c.lambda_2 * (tanh(c.mu * (load + c.edge)) - tanh(c.mu * (load - c.edge))))
    friction = (c.coulomb + c.rise * exp(-c.decay * abs(v))) * tanh(v / c.sharp) + c.viscous * v
    force = c.area * load - friction
    if x > c.half_stroke:
        force -= max(c.stop_stiffness * (x - c.half_stroke) + c.stop_damping * v, 0.0)
    elif x < -c.half_stroke:
        force -= min(c.stop_stiffness * (x + c.half_stroke) + c.stop_damping * v, 0.0)
    v_a = max(c.half_volume + c.area * x, 0.02 * c.half_volume)
    v_b = max(c.half_volume_b - c.area_b * x, 0.02 * c.half_volume_b)
    dp_a = stiffness / v_a * (q_a - c.external * p_a - c.internal * (p_a - p_b) - c.area * v)
    dp_b = stiffness / v_b * (-q_b - c.external * p_b + c.internal * (p_a - p_b) + c.area_b * v)
    speed = min(max(ds, -c.rate_limit), c.rate_limit)
    return v, force / c.mass, dp_a, dp_b, speed, c.omega**2 * (wanted - s) - 2.0 * c.damping * c.omega * ds


def at_rest(c: Constants) -> np.ndarray:
    """Mid-stroke, valve at null, A_A P_A = A_B P_B with P_A + P_B = P_s + P_T; shape (6,)."""
    p_a = (c.supply + c.tank) * c.area_b / (c.area + c.area_b)
    return np.array([0.0, 0.0, p_a, c.supply + c.tank - p_a, 0.0, 0.0])


class Pieces(NamedTuple):
    """Stretches of time in which the spool's position of rest stays, for n samples of at most PIECES.

    counts : (n,). duration : (n, PIECES) [s]. target : (n, PIECES) [-]. From the second piece of a sample on the spool
    starts at rest.
    """

    counts: np.ndarray
    duration: np.ndarray
    target: np.ndarray


PIECES = 6
FINE = 2000  # exact steps of the spool within a sample, between which a halt is found by interpolation


def spool_pieces(commands: np.ndarray, sample_time: float, c: Constants) -> Pieces:
    """Positions of rest of the spool with dry friction (3.19): short of the command, or its own place where held."""
    matrix = np.array([[0.0, 1.0], [-(c.omega**2), -2.0 * c.damping * c.omega]])
    step = expm(sample_time / FINE * matrix)
    return Pieces(*_spool_pieces(np.clip(commands, -1.0, 1.0), sample_time, c.friction, step))


@numba.njit()
def _rest(x, v, u, friction):
    if v == 0.0:
        return x if abs(u - x) <= friction else u - np.sign(u - x) * friction
    return u - np.sign(v) * friction


@numba.njit()
def _spool_pieces(commands, sample_time, friction, step):
    n = len(commands)
    count, duration, target = np.ones(n, np.int64), np.zeros((n, PIECES)), np.zeros((n, PIECES))
    x, v, fine = 0.0, 0.0, sample_time / FINE
    for k in range(n):
        u, piece, begin = commands[k], 0, 0.0
        w = _rest(x, v, u, friction)
        target[k, 0] = w
        for i in range(FINE):
            x_1 = w + step[0, 0] * (x - w) + step[0, 1] * v
            v_1 = step[1, 0] * (x - w) + step[1, 1] * v
            if abs(x_1) > 1.0:
                x_1, v_1 = np.sign(x_1), 0.0
            if friction > 0.0 and v * v_1 < 0.0 and piece + 1 < PIECES:
                part = v / (v - v_1)
                x_1, v_1 = x + 0.5 * part * fine * v, 0.0
                now = (i + part) * fine
                duration[k, piece] = now - begin
                begin, piece = now, piece + 1
                w = _rest(x_1, v_1, u, friction)
                target[k, piece] = w
            x, v = x_1, v_1
        duration[k, piece] = sample_time - begin
        count[k] = piece + 1
    return count, duration, target


def radau(
    commands: np.ndarray, sample_time: float, c: Constants, rtol: float = 1e-9, start: np.ndarray | None = None
) -> np.ndarray:
    """Acceleration at every sample [m/s²], shape (n,): Radau from one change of the held command to the next.

    `start` : state at the first sample, shape (6,); at rest where not given.
    """
    y = at_rest(c) if start is None else start
    return _radau(lambda state, command: rates(state, command, c), commands, sample_time, c, y, rtol * SCALES, rtol)


def _radau(
    rhs: Callable[[np.ndarray, float], tuple[float, ...]],
    commands: np.ndarray,
    sample_time: float,
    c: Constants,
    y: np.ndarray,
    atol: np.ndarray,
    rtol: float,
) -> np.ndarray:
    """The second of the rates at every sample."""
    result = np.empty(len(commands))
    pieces = spool_pieces(commands, sample_time, c)
    for k in range(len(commands)):
        result[k] = rhs(y, pieces.target[k, 0])[1]
        for i in range(pieces.counts[k]):
            target, end = float(pieces.target[k, i]), float(pieces.duration[k, i])
            if i > 0:
                y[5] = 0.0
            solver = Radau(
                lambda _t, state, target=target: np.array(rhs(state, target)), 0.0, y, end, rtol=rtol, atol=atol
            )
            while solver.status == "running":
                solver.step()
            if solver.status != "finished":
                raise RuntimeError(f"Radau failed in sample {k}")
            y = solver.y
    return result


def rates_with_backlash(
    y: Any, wanted: float, c: Any, backlash: tuple[float, float, float, float]
) -> tuple[float, ...]:
    """Rates of eight states: table x, v; P_A, P_B, x_s*, ẋ_s*; piston x, v, which a gap parts from the table.

    backlash : gap g [m], contact stiffness k [N/m], rod mass m_r [kg], damping ratio ζ of the contact on it [-]. With
    q = (5 µm/g)² the contact is k (1 + q) stiff and damped by ζ + (1 − ζ) q/(1 + q).
    """
    gap, stiffness, rod_mass, ratio = backlash
    of_piston = compiled_rates(np.array([y[6], y[7], y[2], y[3], y[4], y[5]]), wanted, c)
    stiffer = (5e-6 / gap) ** 2
    stiffness *= 1.0 + stiffer
    damper = 2.0 * (ratio + (1.0 - ratio) * stiffer / (1.0 + stiffer)) * (stiffness * rod_mass) ** 0.5
    apart, closing = y[6] - y[0], y[7] - y[1]
    contact = 0.0
    if apart > 0.5 * gap:
        contact = max(stiffness * (apart - 0.5 * gap) + damper * closing, 0.0)
    elif apart < -0.5 * gap:
        contact = min(stiffness * (apart + 0.5 * gap) + damper * closing, 0.0)
    of_table = contact / (c.mass - rod_mass)
    return y[1], of_table, *of_piston[2:], y[7], (c.mass * of_piston[1] - contact) / rod_mass


def radau_with_backlash(
    commands: np.ndarray,
    sample_time: float,
    c: Constants,
    backlash: tuple[float, float, float, float],
    rtol: float = 1e-8,
) -> np.ndarray:
    """Acceleration of the table at every sample [m/s²], shape (n,), with backlash between it and the rod."""
    scales = np.concatenate([SCALES, SCALES[:2]])
    scales[[0, 6]] = 1e-4
    y = np.concatenate([at_rest(c), np.zeros(2)])
    return _radau(lambda s, u: rates_with_backlash(s, u, c, backlash), commands, sample_time, c, y, rtol * scales, rtol)


def rates_with_bristles(y: Any, wanted: float, c: Any, law: dict[str, float]) -> tuple[float, ...]:
    """Rates of seven states, the last one the deflection z [m] of LuGre's bristles (3.42)–(3.44), in place of (6.10).

    law : keys of config/friction/lugre.yaml, magnitudes, those of the reverse motion under `_reverse`.
    """
    v, z = y[1], y[6]
    way = "" if v >= 0.0 else "_reverse"
    f_c, f_s = law["coulomb_level" + way], law["static_level" + way]
    g = f_c + (f_s - f_c) * exp(-((abs(v) / law["stribeck_velocity" + way]) ** law["stribeck_exponent" + way]))
    bending = v - law["contact_stiffness"] * abs(v) * z / g
    friction = law["contact_stiffness"] * z + law["contact_damping"] * bending + law["viscous" + way] * v
    of_table = compiled_rates(y[:6], wanted, c._replace(coulomb=0.0, rise=0.0, viscous=0.0))
    return v, of_table[1] - friction / c.mass, *of_table[2:], bending


def radau_with_bristles(
    commands: np.ndarray, sample_time: float, c: Constants, law: dict[str, float], rtol: float = 1e-8
) -> np.ndarray:
    """Acceleration at every sample [m/s²], shape (n,), of the table on LuGre's contact."""
    scales = np.append(10.0 * SCALES, 1e-4)
    scales[0] = 10.0
    y = np.append(at_rest(c), 0.0)
    return _radau(lambda s, u: rates_with_bristles(s, u, c, law), commands, sample_time, c, y, rtol * scales, rtol)


def fine_steps(commands: np.ndarray, sample_time: float, c: Constants, steps: int = 100) -> np.ndarray:
    """All states and the acceleration at every sample, shape (n, 7): classical Runge–Kutta, `steps` a sample."""
    return _fine_steps(*spool_pieces(commands, sample_time, c), sample_time / steps, at_rest(c), c)


_edge_flow = numba.njit()(edge_flow)
compiled_rates = numba.njit()(types.FunctionType(rates.__code__, {**globals(), "edge_flow": _edge_flow}, "rates"))


@numba.njit()
def _fine_steps(count, duration, target, longest, y, c):
    out = np.empty((len(count), 7))
    for k in range(len(count)):
        out[k, :6] = y
        out[k, 6] = compiled_rates(y, target[k, 0], c)[1]
        for i in range(count[k]):
            w = target[k, i]
            steps = max(int(np.ceil(duration[k, i] / longest - 1e-9)), 1)
            h = duration[k, i] / steps
            if i > 0:
                y[5] = 0.0
            for _ in range(steps):
                k1 = np.array(compiled_rates(y, w, c))
                k2 = np.array(compiled_rates(y + 0.5 * h * k1, w, c))
                k3 = np.array(compiled_rates(y + 0.5 * h * k2, w, c))
                k4 = np.array(compiled_rates(y + h * k3, w, c))
                y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                if abs(y[4]) > 1.0:  # |x_s*| ≤ 1
                    y[4] = 1.0 if y[4] > 0.0 else -1.0
                    y[5] = 0.0
    return out


def nrmse(measured: np.ndarray, simulated: np.ndarray) -> float:
    """rms(measured − simulated) / rms(measured − mean) [-]."""
    return float(np.sqrt(np.mean((measured - simulated) ** 2)) / np.std(measured))


def peak_error(measured: np.ndarray, simulated: np.ndarray) -> float:
    """Largest |measured − simulated| relative to the largest |measured| [-]."""
    return float(np.max(np.abs(measured - simulated)) / np.max(np.abs(measured)))


def sine(amplitude: float, frequency: float, duration: float) -> np.ndarray:
    """u = amplitude · sin(2π f t) at 1 kHz [-]."""
    return amplitude * np.sin(2.0 * np.pi * frequency * np.arange(round(duration * 1000)) / 1000.0)


def _doubling() -> np.ndarray:
    """(6.21): the amplitude doubles at 4.35 s."""
    t = np.arange(6000) / 1000.0
    return np.where(t < 4.35, 0.1, 0.2) * np.sin(4.0 * np.pi * t)


def _pulse() -> np.ndarray:
    """A pulse of command one way and back."""
    u = np.zeros(1500)
    u[100:300] = 0.5
    u[700:900] = -0.5
    return u


RUNS: dict[str, np.ndarray] = {  # the thesis's inputs, at 1 kHz
    "0.3 at 2 Hz": sine(0.3, 2.0, 2.0),
    "0.7 at 2 Hz": sine(0.7, 2.0, 2.0),
    "0.99 at 2 Hz": sine(0.99, 2.0, 2.0),
    "0.2 at 5 Hz": sine(0.2, 5.0, 1.0),
    "0.2 at 10 Hz": sine(0.2, 10.0, 1.0),
    "0.1 at 1 Hz": sine(0.1, 1.0, 2.0),
    "u7: 0.8 at 5 Hz": sine(0.8, 5.0, 1.0),
    "u8: 0.9 at 11 Hz": sine(0.9, 11.0, 1.0),
    "pulse": _pulse(),
    "amplitude doubled, 2 Hz": _doubling(),
}
