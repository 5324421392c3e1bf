"""What laboratories do to their recordings: changes of the columns of a run, for laboratory_conditions.py."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

Columns = dict[str, np.ndarray]
Disturbance = Callable[[Columns, np.random.Generator], Columns]


def every(change: Callable[[np.ndarray, np.random.Generator], np.ndarray], *names: str) -> Disturbance:
    """The same change of some columns."""
    return lambda run, rng: run | {n: change(run[n], rng) for n in names}


def jitter(share: float) -> Disturbance:
    """Stamps off by up to a share of the period; the samples themselves are regular."""

    def change(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return np.asarray(t + share * (t[1] - t[0]) * rng.uniform(-1.0, 1.0, len(t)))

    return every(change, "t")


def rows_absent(share: float) -> Disturbance:
    """A share of the rows is not there."""

    def change(run: Columns, rng: np.random.Generator) -> Columns:
        kept = rng.uniform(size=len(run["t"])) >= share
        return {n: values[kept] for n, values in run.items()}

    return change


def cells_empty(share: float) -> Disturbance:
    """A share of the cells of the signals is empty."""

    def change(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return np.where(rng.uniform(size=len(values)) < share, np.nan, values)

    return every(change, "u", "x", "a")


def rows_twice(run: Columns, rng: np.random.Generator) -> Columns:
    """One row in two hundred is written twice."""
    count = 1 + (rng.uniform(size=len(run["t"])) < 0.005)
    return {n: np.repeat(values, count) for n, values in run.items()}


def steps(name: str, step: float) -> Disturbance:
    """A column in steps."""
    return every(lambda values, rng: step * np.round(values / step), name)


def clipped(name: str, share: float) -> Disturbance:
    """A column that ends at a share of its peak."""
    return every(lambda v, rng: np.clip(v, -share * np.max(np.abs(v)), share * np.max(np.abs(v))), name)


def spikes(run: Columns, rng: np.random.Generator) -> Columns:
    """One sample of the recorded command off at each beat of two sampling rates, which the valve never saw."""
    command = run["u"].copy()
    at = np.arange(37, len(command), 173)
    command[at] += 3.0 * np.std(command) * rng.choice((-1.0, 1.0), len(at))
    return run | {"u": command}


def moved(samples: int) -> Disturbance:
    """The command recorded later by some samples."""

    def change(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return (
            np.concatenate([np.zeros(samples), values[:-samples]])
            if samples > 0
            else np.append(values[-samples:], np.zeros(-samples))
        )

    return every(change, "u")


def drifting(name: str, size: float) -> Disturbance:
    """A zero that wanders by `size` over the run."""
    return every(lambda values, rng: values + size * np.sin(np.linspace(0.0, 2.0, len(values))), name)


def without(*names: str) -> Disturbance:
    """Columns that are not there."""
    return lambda run, rng: {n: v for n, v in run.items() if n not in names}


def own_clock(run: Columns, rng: np.random.Generator) -> Columns:
    """The acceleration in a file of its own: started up to 0.8 s away, at 480 Hz, its clock 50 ppm fast."""
    t = run["t"]
    late = float(rng.uniform(-0.8, 0.8))
    own = np.arange(0.0, t[-1] - t[0] - abs(late), 1.0 / 480.0)
    true = own / (1.0 + 50e-6) + max(late, 0.0)
    return {"ts": own + 100.0, "a": CubicSpline(t, run["a"])(true)}


def sine(run: Columns, rng: np.random.Generator) -> Columns:
    """A sine alone: a table as a pure integrator of its command."""
    t = run["t"]
    u = 0.3 * np.sin(2.0 * np.pi * 2.0 * t)
    x = -0.01 * np.cos(2.0 * np.pi * 2.0 * t) + 3e-6 * rng.standard_normal(len(t))
    a = 0.01 * (4.0 * np.pi) ** 2 * np.cos(2.0 * np.pi * 2.0 * t) + 0.02 * rng.standard_normal(len(t))
    return run | {"u": u, "x": x, "a": a}


def scaled(name: str, factor: float, offset: float = 0.0) -> Disturbance:
    """A column in another unit."""
    return every(lambda values, rng: factor * values + offset, name)


def swapped(run: Columns, rng: np.random.Generator) -> Columns:
    """Command and position exchanged."""
    return run | {"u": run["x"], "x": run["u"]}
