"""identify against the same fit done plainly: python benchmarks/identify_speed.py [--seconds 15] [--part 1.0]

Three recordings of 15 s at 1 kHz by benchmarks/hidden_tables.py, eight parameters. Ours: the whole of `identify`, with
its several starts and standard errors, by the wall clock after start-up. Plainly: scipy's least_squares (the same
trust-region method, differences by itself) on solve_ivp with the right-hand side of test/reference_model.py, from one
start. A plain run takes many minutes, so it is timed in parts, and the parts and factors are printed: seconds per
second of recording (the fastest of several methods on the first --part seconds of each recording), times the length,
times the number of simulations, which a plain fit of a part of one recording needs to converge (or --evaluations).
Both are asked for the accuracy that keeps the acceleration within about 0.1 %.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks"), str(ROOT / "test")]

import hidden_tables as hidden  # noqa: E402
import reference_model as reference  # noqa: E402

from shake_ros.cli.fitting import declared_parameters  # noqa: E402
from shake_ros.core.discovery.closing import identify  # noqa: E402
from shake_ros.core.identification.recordings import Record, derivative, low_pass  # noqa: E402
from shake_ros.core.plant.simulation import workers  # noqa: E402
from shake_ros.settings import load_table  # noqa: E402

FIELDS = ("coulomb", "rise", "decay", "viscous", "modulus", "internal", "external", "flow")
SCALES = np.array([50.0, 50.0, 2.0, 50.0, 1e8, 1e-12, 1e-12, 1e-8])
HIGH = np.array([5e3, 5e3, 300.0, 2e4, 1e10, 5e-10, 5e-10, 1e-6]) / SCALES
LOW = np.array([0.0, 0.0, 0.5, 0.0, 5e7, 0.0, 0.0, 2e-8]) / SCALES
METHODS = ("RK45", "LSODA", "Radau")
TOLERANCE = 1e-5


def recordings(seconds: float) -> list[Record]:
    """Three recordings of one table that lacks nothing."""
    truth, rng = hidden.declared_truth(1), np.random.default_rng(1)
    result = []
    for seed in range(3):
        excitation = hidden.multisine(seconds / 3.0, 3, 0.4, 8.0, 0.2, np.random.default_rng(seed))
        made = hidden.record(truth, excitation, 1.0, rng)
        result.append(Record(f"run_{seed}", hidden.SAMPLE, made["command"], made["position"], made["acceleration"]))
    return result


def plain_run(x: np.ndarray, commands: np.ndarray, method: str) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration of a free run with solve_ivp, the command held from sample to sample."""
    c = reference.constants()._replace(mass=650.0, **dict(zip(FIELDS, (x * SCALES).tolist(), strict=True)))
    wanted = reference.spool_commands(commands, c.play)
    last = len(wanted) - 1

    def right(t: float, y: np.ndarray) -> tuple[float, ...]:
        return reference.rates(y, wanted[min(int(t / hidden.SAMPLE), last)], c)

    stop = (len(wanted) - 1) * hidden.SAMPLE
    solved = solve_ivp(
        right,
        (0.0, stop),
        reference.at_rest(c),
        method,
        np.minimum(np.arange(len(wanted)) * hidden.SAMPLE, stop),
        rtol=TOLERANCE,
        atol=TOLERANCE * reference.SCALES,
        max_step=hidden.SAMPLE,
    )
    acceleration = np.array([reference.rates(y, w, c)[1] for y, w in zip(solved.y.T, wanted, strict=True)])
    return solved.y[1], acceleration


def plain_fit(records: list[Record], start: np.ndarray, method: str) -> int:
    """A plain fit; returns the number of simulations of all records that it took."""
    count = 0

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        parts = []
        for r in records:
            velocity, acceleration = plain_run(x, r.commands, method)
            parts.append((low_pass(velocity, r.sample_time) - derivative(r.position, r.sample_time)) / 0.003)
            assert r.acceleration is not None
            parts.append((acceleration - r.acceleration) / 0.05)
        return np.concatenate(parts)

    least_squares(residuals, start, bounds=(LOW, HIGH), x_scale="jac", diff_step=2e-3, ftol=1e-6, xtol=1e-6)
    return count


def shortened(record: Record, seconds: float) -> Record:
    """The start of a recording."""
    n = round(seconds / record.sample_time)
    assert record.acceleration is not None
    return Record(record.name, record.sample_time, record.commands[:n], record.position[:n], record.acceleration[:n])


def timed(work: Callable[[], object]) -> float:
    """Wall clock of `work` [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    """Time both and print every factor."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--seconds", type=float, default=15.0, help="length of each recording")
    command.add_argument("--part", type=float, default=1.0, help="seconds of each that are timed plainly")
    command.add_argument("--evaluations", type=int, help="simulations of a plain fit (default: counted on a part)")
    given = command.parse_args()
    records = recordings(given.seconds)
    free, table = declared_parameters("full"), load_table("bergamo")

    def ours(some: list[Record]) -> object:
        return identify(table, free, some, [], lambda text, part: None)

    ours([shortened(records[0], 1.0)])  # start-up: compiling or loading what is compiled
    seconds = min(timed(lambda: ours(records)) for _ in range(2))
    print(f"identify, three recordings of {given.seconds:g} s, 8 parameters, {workers()} cores: {seconds:.1f} s")

    start = np.array([getattr(reference.constants(), f) for f in FIELDS]) / SCALES
    pieces = [shortened(r, given.part) for r in records]
    costs = {}
    for method in METHODS:
        costs[method] = timed(lambda m=method: [plain_run(start, p.commands, m) for p in pieces]) / (3.0 * given.part)
        print(f"solve_ivp {method}: {costs[method]:.3f} s per second of recording")
    best = min(costs, key=lambda m: costs[m])
    evaluations = given.evaluations
    if evaluations is None:
        some = [shortened(records[0], 0.15 * given.seconds)]
        evaluations = plain_fit(some, start, best)
        print(f"simulations of a plain fit, counted on the first {0.15 * given.seconds:.2g} s of one: {evaluations}")
    plain = costs[best] * 3.0 * given.seconds * evaluations
    print(f"plain fit: {costs[best]:.3f} × {3.0 * given.seconds:g} s × {evaluations} = {plain:.0f} s (scaled, not run)")
    print(f"ratio {plain / seconds:.0f}")


if __name__ == "__main__":
    main()
