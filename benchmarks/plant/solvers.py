"""Speed and accuracy of the plant alone: python -m benchmarks.plant.solvers [--full] [--save].

Prints four tables: the thesis's runs with their error against an independent solution; other solvers at the same
accuracy on the same run, one of them in C (declared_table.c) made by the system's compiler where there is one; the
cost against simulated time, number of effects and batch size; the batch of 1000 runs. The independent solution is
reference_model.py (written from the equation sheet, not by calling the package) with steps of 10 µs; Radau at
rtol 1e-9 takes the first 0.06 s of each run, with --full the whole of it. Times are of the processor on one thread,
the best of three after warm-up, so that other programs do not count; those of batches are printed by the wall clock as
well. --full also runs all 1000 simulations; --save writes benchmarks/plant/solvers.txt.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.plant import reference_model as reference
from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant.simulation import TOLERANCE, initial_state, run, run_batch, workers
from shake_ros.settings import load_table

SAMPLE = 0.001
BERGAMO = load_table("bergamo")
Solver = Callable[[np.ndarray, float], np.ndarray]  # commands, fineness → acceleration

SEVERAL = {  # effects that lengthen the right-hand side, in the order in which they are switched on
    "effects.soft_zone.depth": 0.84,
    "effects.friction_asymmetry.asymmetry": 0.2,
    "effects.turbulent_leakage.coefficient": 1e-10,
    "effects.entrained_air.fraction": 0.002,
    "effects.pressure_dependent_bulk_modulus.slope": 9.0,
    "effects.supply_droop.resistance": 2e9,
    "effects.film_friction.relief": 0.3,
    "effects.specimen_resonance.mass": 50.0,
    "effects.accelerometer_lag.time_constant": 0.001,
    "effects.position_sensor_lag.time_constant": 0.001,
    "effects.base_flexibility.compliance": 2e-9,
    "effects.presliding_friction.distance": 2e-4,
    "effects.command_delay.delay": 0.003,
}


def best(work: Callable[[], object], repeats: int = 3) -> float:
    """Shortest processor time of `work` on this thread [s]."""
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return min(times)


def both_clocks(work: Callable[[], object], repeats: int = 3) -> tuple[float, float]:
    """Shortest duration by the wall clock and least processor time of all threads [s]."""
    walls, processors = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        work()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    return min(walls), min(processors)


def thesis_runs(full: bool) -> Iterator[str]:
    """Speed of every run and its error against the independent solution; that solution's own error against Radau."""
    yield f"{'run':26s} {'modulus':9s} {'x real time':>11s} {'NRMSE':>9s} {'largest':>9s} {'to Radau':>9s}"
    for name, commands in reference.RUNS.items():
        for modulus, depth in (("constant", 0.0), ("soft zone", 0.84)):
            table = BERGAMO.with_values({"effects.soft_zone.depth": depth}) if depth else BERGAMO
            constants = reference.constants(depth)
            solution = reference.fine_steps(commands, SAMPLE, constants)[:, 6]
            result = run(table, commands, SAMPLE)[:, 2]
            speed = len(commands) * SAMPLE / best(partial(run, table, commands, SAMPLE))
            count = len(commands) if full else 60
            start = 80 if name == "pulse" and not full else 0
            radau = reference.radau(commands[start : start + count], SAMPLE, constants)
            ours = run(table, commands[start : start + count], SAMPLE)[:, 2]
            yield (
                f"{name:26s} {modulus:9s} {speed:11.0f} {reference.nrmse(solution, result):9.1e} "
                f"{reference.peak_error(solution, result):9.1e} {reference.nrmse(radau, ours):9.1e}"
            )


def by_solve_ivp(method: str) -> Solver:
    """scipy's solver with the reference's compiled right-hand side, restarted at every change of the held command."""

    def solve(commands: np.ndarray, fineness: float) -> np.ndarray:
        c = reference.constants(friction=0.0)
        y, result = reference.at_rest(c), np.empty(len(commands))
        for k, u in enumerate(commands):
            result[k] = reference.compiled_rates(y, u, c)[1]
            atol = fineness * reference.SCALES
            done = solve_ivp(
                lambda _t, y, u=u: reference.compiled_rates(y, u, c), (0.0, SAMPLE), y, method, rtol=fineness, atol=atol
            )
            y = done.y[:, -1]
        return result

    return solve


def by_plain_numpy(commands: np.ndarray, fineness: float) -> np.ndarray:
    """Classical Runge–Kutta in plain Python and numpy; `fineness` is the number of steps a sample, inverted."""
    c, h = reference.constants(friction=0.0), SAMPLE * fineness
    y, result = reference.at_rest(c), np.empty(len(commands))
    for k, u in enumerate(commands):
        result[k] = reference.rates(y, u, c)[1]
        for _ in range(round(1.0 / fineness)):
            k1 = np.array(reference.rates(y, u, c))
            k2 = np.array(reference.rates(y + 0.5 * h * k1, u, c))
            k3 = np.array(reference.rates(y + 0.5 * h * k2, u, c))
            k4 = np.array(reference.rates(y + h * k3, u, c))
            y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return result


def by_cvode(commands: np.ndarray, fineness: float) -> np.ndarray:
    """SUNDIALS CVODE (package scikit-sundae) with the compiled right-hand side, restarted at every new command."""
    from sksundae.cvode import CVODE

    c = reference.constants(friction=0.0)
    held = {"u": 0.0}

    def rates(_t: float, y: np.ndarray, yp: np.ndarray) -> None:
        yp[:] = reference.compiled_rates(y, held["u"], c)

    solver = CVODE(rates, rtol=fineness, atol=fineness * reference.SCALES)
    y, result = reference.at_rest(c), np.empty(len(commands))
    for k, u in enumerate(commands):
        result[k] = reference.compiled_rates(y, u, c)[1]
        held["u"] = u
        y = solver.solve(np.array([0.0, SAMPLE]), y).y[-1]
    return result


@cache
def compiled_c(_folder: tempfile.TemporaryDirectory[str]) -> ctypes.CDLL:
    """benchmarks/declared_table.c made by the system's compiler; ImportError where there is none."""
    compiler = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
    if compiler is None:
        raise ImportError("no C compiler (Debian, Ubuntu: apt-get install gcc libc6-dev)")
    library = Path(_folder.name) / "declared_table.so"
    source = Path(__file__).with_name("declared_table.c")
    subprocess.run(
        [compiler, "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True
    )
    made = ctypes.CDLL(str(library))
    made.simulate.restype = ctypes.c_double
    return made


def by_c(commands: np.ndarray, fineness: float) -> np.ndarray:
    """The declared table in C, Dormand–Prince 5(4) with error control, no package involved."""
    library, c = compiled_c(FOLDER), CONSTANTS
    y, result = reference.at_rest(c), np.empty(len(commands))
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (c, commands, reference.SCALES)]
    pointer = ctypes.POINTER(ctypes.c_double)
    given, held, scales, state, out = (a.ctypes.data_as(pointer) for a in (*arrays, y, result))
    sample, tolerance = ctypes.c_double(SAMPLE), ctypes.c_double(fineness)
    spent = library.simulate(given, held, ctypes.c_long(len(commands)), sample, tolerance, scales, state, out)
    IN_C.append(spent)
    return result


IN_C: list[
    float
] = []  # processor time of each run in C, by its own clock: the way there from Python does not count [s]
FOLDER = tempfile.TemporaryDirectory()
CONSTANTS = reference.constants(friction=0.0)  # read once, not within a measured run
LADDER = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8)
SOLVERS: dict[str, tuple[Solver, tuple[float, ...]]] = {
    "scipy LSODA, compiled rhs": (by_solve_ivp("LSODA"), LADDER),
    "scipy Radau, compiled rhs": (by_solve_ivp("Radau"), LADDER),
    "scipy RK45, compiled rhs": (by_solve_ivp("RK45"), LADDER),
    "numpy RK4, plain rhs": (by_plain_numpy, (1.0, 0.5, 0.2, 0.1, 0.05)),
    "C (system compiler), DP 5(4)": (by_c, LADDER),
    "CVODE, compiled rhs": (by_cvode, LADDER),
}


def other_solvers(full: bool) -> Iterator[str]:
    """Each solver at the coarsest setting that is as accurate as ours on the same run."""
    commands = reference.RUNS["0.7 at 2 Hz"][: 1000 if full else 300]
    table = BERGAMO.with_values({"valve.hysteresis": 0.0})  # the others would need its events
    solution = reference.fine_steps(commands, SAMPLE, CONSTANTS)[:, 6]
    error = reference.nrmse(solution, run(table, commands, SAMPLE)[:, 2])
    ours = best(lambda: run(table, commands, SAMPLE))
    seconds = len(commands) * SAMPLE
    head = "0.7 at 2 Hz, no hysteresis"
    yield f"{head:30s} {'setting':>8s} {'NRMSE':>9s} {'x real time':>11s} {'ours is faster by':>18s}"
    yield f"{'ours':30s} {TOLERANCE:8.0e} {error:9.1e} {seconds / ours:11.1f} {1.0:18.3g}"
    for name, (solve, ladder) in SOLVERS.items():
        try:
            solve(commands[:2], ladder[0])
        except ImportError as missing:
            yield f"{name:30s} left out: {missing}"
            continue
        for fineness in ladder:
            start = time.thread_time()
            found = reference.nrmse(solution, solve(commands, fineness))
            spent = time.thread_time() - start
            if spent < 0.1:  # too short for one measurement
                spent = best(partial(solve, commands, fineness))
            spent = min(IN_C[-3:]) if solve is by_c else spent
            if found <= error:
                break
        yield f"{name:30s} {fineness:8.0e} {found:9.1e} {seconds / spent:11.2f} {spent / ours:18.3g}"


def growth() -> Iterator[str]:
    """Cost against simulated time, number of effects and batch size."""
    parts = []
    for seconds in (1.0, 10.0, 60.0):
        commands = reference.sine(0.5, 2.0, seconds)
        parts.append(f"{seconds:g} s {1e3 * best(partial(run, BERGAMO, commands, SAMPLE)):.1f} ms")
    yield "simulated time: " + ", ".join(parts)
    commands = reference.sine(0.5, 2.0, 5.0)
    parts = []
    for count in (0, 1, 3, 5, 6, 9, len(SEVERAL)):
        table = BERGAMO.with_values(dict(list(SEVERAL.items())[:count]))
        parts.append(f"{count} {5.0 / best(partial(run, table, commands, SAMPLE)):.0f} x")
    yield f"effects switched on, of {len(EFFECTS)} compiled in: " + ", ".join(parts)
    parts = []
    for size in (1, 2, 8, 32, 128):
        vectors, starts = batch(size)
        wall, _ = both_clocks(partial(run_batch, vectors, starts, commands[:1000], SAMPLE))
        parts.append(f"{size} {1e3 * wall / size:.2f} ms")
    yield f"batch on {workers()} cores, wall clock for each run of 1 s: " + ", ".join(parts)


def batch(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Parameter sets that differ in mass, modulus, flow gain and friction, and their states at rest."""
    draw = np.random.default_rng(1)
    tables = [
        BERGAMO.with_values(
            {
                "body.specimen_mass": draw.uniform(0.0, 600.0),
                "bulk_modulus.modulus": draw.uniform(0.5e9, 1.5e9),
                "valve.flow_coefficient": draw.uniform(1.4e-7, 2.0e-7),
                "friction.coulomb_level": draw.uniform(50.0, 500.0),
            }
        )
        for _ in range(size)
    ]
    vectors = np.array([t.vector() for t in tables])
    return vectors, np.array([initial_state(v) for v in vectors])


def thousand(full: bool) -> Iterator[str]:
    """1000 simulations of 10 s with different parameters."""
    size = 1000 if full else 60
    vectors, starts = batch(size)
    commands = reference.sine(0.5, 2.0, 10.0)
    wall, processor = both_clocks(lambda: run_batch(vectors, starts, commands, SAMPLE, columns=(2,)), repeats=1)
    said = "measured" if full else f"estimated from {size}"
    scale = 1000 / size
    took = f"{wall * scale:.1f} s by the wall clock, {processor * scale:.1f} s of processor time"
    yield f"1000 simulations of 10 s on {workers()} cores: {took} ({said})"


def report(full: bool) -> Iterator[str]:
    """All tables, line by line."""
    yield (
        f"{time.strftime('%Y-%m-%d')}, {workers()} cores {platform.machine()}, Python {platform.python_version()}, "
        f"numba {version('numba')}, scipy {version('scipy')}, load {os.getloadavg()[0]:.1f}"
    )
    run(BERGAMO, np.zeros(10), SAMPLE)
    for part in (thesis_runs(full), other_solvers(full), growth(), thousand(full)):
        yield ""
        yield from part


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--full", action="store_true", help="all 1000 simulations, Radau over whole runs: many minutes")
    parser.add_argument("--save", action="store_true", help="write the tables to benchmarks/plant/solvers.txt as well")
    arguments = parser.parse_args()
    lines = []
    for line in report(arguments.full):
        print(line, flush=True)
        lines.append(line)
    if arguments.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
