"""The reduced model against an outside tool on measured data.

    python -m benchmarks.identification.outside_tool [--data DIR]

Data: open-loop runs of a motor-driven table that others recorded (electric_table; position and command at 200 Hz).
Learned on three sines, held out a sine, a square wave and an earthquake. Ours: the five parameters of (6.36), then
with dry friction that differs by direction, which is what `close_loop` is for. The outside tool: SysIdentPy's FROLS,
a polynomial NARX model of velocity from command with up to LAGS past values of both, its terms chosen by itself
(BIC), degrees one to three. Both see the same velocity (zero-phase filtered rate of the position); SysIdentPy gets
the three runs one after the other, since it takes one record. The error is that of the free run, rms(measured −
simulated)/rms(measured − mean); NARX starts each run with its first measured values, ours with the first velocity.

SysIdentPy is no dependency of the package: without it (`pip install sysidentpy` in an environment of its own) only
our rows are printed, with the reason.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import ROOT
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, relative_error
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.signals.velocity_filter import filtered_velocity

LEARN = ("SineA02F02", "SineA05F03", "SineA3F08")
HOLD = ("SineA1F1", "SquareA05F1", "seisme")
LAGS = 14  # samples: 70 ms, more than the 45 to 55 ms from command to velocity
START_FRICTION = 50.0  # first guess of the dry friction [units/s³], of the size of β_3 times the dead command


def read(folder: Path, name: str) -> Record:
    """One run; time, command and position are its first, third and fourth column."""
    table = np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True)
    return Record(name, float(np.mean(np.diff(table["t_s"]))), table["ut"].copy(), table["position"].copy())


def reduced(learn: list[Record], with_friction: bool) -> TableParameters:
    """The fitted reduced model."""
    problem = RecordingProblem(learn, REDUCED)
    declared = FreeParameters(REDUCED.first_table(learn), free_parameters(REDUCED))
    first = fit(problem, declared, declared.start(), evaluations=60)
    if not with_friction:
        return declared.table(first.x)
    pool = {c.effect: c for c in effect_candidates(REDUCED)}
    more = [*pool["coulomb_friction"].free, *pool["friction_asymmetry"].free]
    extended = FreeParameters(declared.table(first.x), [*free_parameters(REDUCED), *more])
    start = extended.x_of({"effects.coulomb_friction.force": START_FRICTION})
    return extended.table(fit(problem, extended, start, evaluations=60).x)


def narx(learn: list[Record], degree: int) -> tuple[Callable[[Record], np.ndarray], str]:
    """A NARX model of SysIdentPy: its free run over a record, and what it consists of."""
    from sysidentpy.basis_function import Polynomial  # an optional tool
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    lags = LAGS if degree == 1 else LAGS // degree
    command = list(range(1, LAGS + 1, 1 if degree == 1 else degree))
    model = FROLS(
        order_selection=True,
        n_info_values=20,
        ylag=lags,
        xlag=command,
        info_criteria="bic",
        estimator=LeastSquares(),
        basis_function=Polynomial(degree=degree),
    )
    u = np.concatenate([r.commands for r in learn])[:, None]
    y = np.concatenate([r.velocity for r in learn])[:, None]
    model.fit(X=u, y=y)

    def run(record: Record) -> np.ndarray:
        return np.asarray(model.predict(X=record.commands[:, None], y=record.velocity[: LAGS + 1, None]))[:, 0]

    return run, f"{len(model.final_model)} terms"


def errors(records: list[Record], run: Callable[[Record], np.ndarray]) -> list[float]:
    """Relative error of the velocity of the free run on each record."""
    found = []
    for r in records:
        simulated = run(r)[: len(r.velocity)]
        good = np.isfinite(simulated).all() and np.max(np.abs(simulated)) < 1e6
        found.append(relative_error(r.velocity[r.start :], simulated[r.start :]) if good else np.inf)
    return found


def row(name: str, seconds: float, found: list[float]) -> str:
    """A line of the table."""
    cells = "".join("  diverges" if not np.isfinite(e) or e > 10.0 else f"{100.0 * e:8.1f} %" for e in found)
    return f"{name:46}{seconds:7.1f} s{cells}"


def main() -> None:
    """Fit all and print the free-run errors side by side."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data" / "electric_table")
    given = command.parse_args()
    if not given.data.is_dir():
        sys.exit(f"{given.data}: no such folder; --data names the one with the runs")
    records = {name: read(given.data, name) for name in (*LEARN, *HOLD)}
    learn = [records[name] for name in LEARN]
    print(f"{'free-run error of the velocity':46}{'fit':>9}" + "".join(f"{n[:9]:>10}" for n in records))
    print(f"{'':46}{'':9}" + "".join(f"{'learn' if n in LEARN else 'hold':>10}" for n in records))
    reduced(learn, False)  # start-up: compiling or loading what is compiled
    for title, friction in (("ours: (6.36)", False), ("ours: (6.36), friction differing by direction", True)):
        start = time.perf_counter()
        table = reduced(learn, friction)
        seconds = time.perf_counter() - start

        def ours(record: Record, table: TableParameters = table) -> np.ndarray:
            return filtered_velocity(REDUCED.run(table, record)[:, 1], record.sample_time)

        print(row(title, seconds, errors(list(records.values()), ours)))
    for degree in (1, 2, 3):
        start = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                run, what = narx(learn, degree)
                seconds = time.perf_counter() - start
                found = errors(list(records.values()), run)
        except ImportError as error:
            print(f"SysIdentPy: not run ({error})")
            return
        print(row(f"SysIdentPy FROLS, degree {degree}, {what}", seconds, found))


if __name__ == "__main__":
    main()
