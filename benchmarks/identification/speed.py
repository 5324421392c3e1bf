"""identify against the same fit done plainly.

    python -m benchmarks.identification.speed [--seconds 15] [--part 1.0]

Three recordings of 15 s at 1 kHz by discovery/hidden_tables.py, eight parameters. Ours: the whole of `identify`, with
its several starts and standard errors, by the wall clock after start-up. Plainly: scipy's least_squares (the same
trust-region method, differences by itself) on solve_ivp with the right-hand side of plant/reference_model.py, from one
start. A plain run takes many minutes, so it is timed in parts, and the parts and factors are printed: seconds per
second of recording (the fastest of several methods on the first --part seconds of each recording), times the length,
times the number of simulations that a fit by the same trust-region method takes from one start (or --evaluations).
Both are asked for the accuracy that keeps the acceleration within about 0.1 %.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.discovery import hidden_tables as hidden
from benchmarks.plant import reference_model as reference
from shake_ros.declared import free_parameters, model_structure
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.physics.plant.simulation import workers
from shake_ros.search.declared_fit import identify
from shake_ros.settings import load_search, load_table

FIELDS = ("coulomb", "rise", "decay", "viscous", "modulus", "internal", "external", "flow")
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
    c = reference.constants()._replace(mass=650.0, **dict(zip(FIELDS, x.tolist(), strict=True)))
    wanted = commands  # without the valve's hysteresis, which would need its own events
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


class PlainProblem:
    """A problem of recordings whose fit takes differences at each step, as least_squares does by itself."""

    def __init__(self, records: list[Record]) -> None:
        self.residuals = RecordingProblem(records).residuals


def simulations(records: list[Record]) -> int:
    """Simulations of all records that a fit from the catalogue's values takes with differences by forward steps."""
    free = FreeParameters(load_table("bergamo"), free_parameters())
    return fit(PlainProblem(records), free, free.start(), evaluations=200, tolerance=1e-6).evaluations


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
    command.add_argument("--evaluations", type=int, help="simulations of a plain fit (default: counted)")
    given = command.parse_args()
    records = recordings(given.seconds)
    model = model_structure(load_table("bergamo"))

    def ours(some: list[Record]) -> object:
        return identify(model, some, [], load_search(), lambda text, part: None)

    ours([shortened(records[0], 1.0)])  # start-up: compiling or loading what is compiled
    seconds = min(timed(lambda: ours(records)) for _ in range(2))
    print(f"identify, three recordings of {given.seconds:g} s, 8 parameters, {workers()} cores: {seconds:.1f} s")

    start = np.array([getattr(reference.constants(), f) for f in FIELDS])
    pieces = [shortened(r, given.part) for r in records]
    costs = {}
    for method in METHODS:
        costs[method] = sum(timed(partial(plain_run, start, p.commands, method)) for p in pieces) / (3.0 * given.part)
        print(f"solve_ivp {method}: {costs[method]:.3f} s per second of recording")
    best = min(costs, key=lambda m: costs[m])
    evaluations = given.evaluations or simulations(records)
    print(f"simulations of a fit by the same method from one start: {evaluations}")
    plain = costs[best] * 3.0 * given.seconds * evaluations
    print(f"plain fit: {costs[best]:.3f} × {3.0 * given.seconds:g} s × {evaluations} = {plain:.0f} s (scaled, not run)")
    print(f"ratio {plain / seconds:.0f}")


if __name__ == "__main__":
    main()
