"""What each observer is worth on the full plant: python -m benchmarks.control.observers [--save] [--measured FOLDER].

Table bergamo with the thesis's soft zone (depth 0.84) and one sample of delay, 0, 200 and 500 kg; position with 8 µm of
noise and 16 bits over 300 mm, 1 kHz. The table follows each reference under the model feedforward on its true states;
the observers get the recorded command and position, so all of them see the same runs, with one set of gains for
all loads. Normalised root mean square errors in percent, `velocity/acceleration`, the largest over the loads:

* as identified: the observers that carry a table carry the plant's, those of the reduced model their configured β;
* at standstill: standard deviation of the estimates; chatter: total variation of the acceleration's error per second
  without noise and steps on the sine of 20 mm; largest velocity error on the records beside the best
  bound 2√(2NL) + LΔ/2 that an exact differentiator can promise;
* wrong: one quantity of the model off by 20 %, the soft zone left out of the model, effects in the plant alone: a dead
  band of 3 %, a null shift of 3 %.

Below: Levant's differentiator and the thesis's observer by forward Euler, for comparison; the latter as (6.38) and with
the gate of (5.49), which in discrete time never opens. --measured takes strong-motion records instead of the synthetic
ones, at most 20 s of each; --layers prints the boundary layers of
config/observer/sliding_mode_tuned.yaml and model_sliding_mode.yaml; --save writes benchmarks/control/observers.txt.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shake_ros.compiled import njit
from shake_ros.control.closed_loop import Loop, normalised_error, simulate
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.linear import LinearObserver, kalman_gain
from shake_ros.control.observer.model_sliding_mode import ModelSlidingModeObserver
from shake_ros.control.observer.robust_exact_differentiator import GAINS, worst_case
from shake_ros.control.observer.runner import Observer
from shake_ros.control.observer.sliding_mode import SlidingModeObserver
from shake_ros.control.reference.program import Program
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.recordings.reference_file import build_program, load_reference, make_program
from shake_ros.settings import load_table, load_variant

Array = NDArray[np.float64]
SAMPLE_TIME = 0.001
FIRST = 500  # first sample that counts
LONGEST = 20_000
LOADS = (0.0, 200.0, 500.0)
PLANT = {"effects.soft_zone.depth": 0.84, "effects.command_delay.delay": SAMPLE_TIME}
SINES = ("sine_20mm_2hz", "sine_50mm_1hz")
RECORDS = ("earthquake_soft_soil", "earthquake_stiff_soil", "earthquake_rock")
MEASURED = (
    "LomaPrieta1989_SFShafter_0111a.smc",
    "Whittier1987_Alhambra_0165b_a.smc",
    "Coalinga1983_ParkfieldFZ14_CE36456.V2",
)
LACKED = {
    "dead band 3 %": {"effects.spool_deadband.width": 0.03},
    "shift 3 %": {"effects.valve_null_shift.offset": 0.03},
}
NAMES = (
    "model_soft_zone",
    "model_sliding_mode",
    "model",
    "linear_soft_zone",
    "linear_bergamo",
    "robust_exact_differentiator",
    "sliding_mode_tuned",
    "sliding_mode",
)
EXPLICIT_BOUND = 150.0  # L of the explicit differentiator [m/s³]


class Run(NamedTuple):
    """A run of the plant: which, its table, truth (n, 3), measured position (n,) and command (n,)."""

    reference: str
    load: float
    table: TableParameters
    truth: Array
    measured: Array
    command: Array


def programs(measured: Path | None) -> dict[str, Program]:
    """The five references by name."""
    found = {name: build_program(name, SAMPLE_TIME) for name in SINES}
    if measured is None:
        return found | {name: build_program(name, SAMPLE_TIME) for name in RECORDS}
    reference = load_reference("earthquake")
    for name in MEASURED:
        parameters = reference.parameters.replace(record=str(measured / name))
        found[name.partition("_")[0]] = make_program(reference._replace(parameters=parameters), SAMPLE_TIME)
    return found


def record_run(name: str, program: Program, load: float, effects: Mapping[str, float]) -> Run:
    """The table with a load and effects under the model feedforward of that very table."""
    table = load_table("bergamo").with_values({**PLANT, **effects, "body.specimen_mass": load})
    kind, parameters = load_variant("controller", "super_twisting_tuned", CONTROLLERS)
    law = Controller(kind, parameters, SAMPLE_TIME, table)
    samples = min(program.length, LONGEST)
    loop, _ = simulate(Loop(table, None, law, program.samples(0, samples), seed=3))
    return Run(name, load, table, loop.truth, np.ascontiguousarray(loop.measured[:, 0]), loop.command)


def wrong_model(case: str, table: TableParameters) -> TableParameters:
    """The model of a case, from the plant's table."""
    scaled = {"oil -20 %": ("bulk_modulus.modulus", 0.8), "valve +20 %": ("valve.flow_coefficient", 1.2)}
    if case in scaled:
        name, factor = scaled[case]
        return table.with_values({name: factor * table.value(name)})
    if case == "mass +20 %":
        return table.with_values({"body.table_mass": table.body.table_mass + 0.2 * table.moved_mass})
    if case == "no soft zone":
        return table.with_values({"effects.soft_zone.depth": 0.0})
    return table.with_values(dict.fromkeys(LACKED.get(case, {}), 0.0))


def wrong_beta(case: str, p: Any) -> Any:
    """The same change on β_1 … β_5."""
    if case == "oil -20 %":
        return p.replace(beta1=0.8 * p.beta1, beta3=0.8 * p.beta3, beta4=0.8 * p.beta4)
    if case == "valve +20 %":
        return p.replace(beta3=1.2 * p.beta3, beta4=1.2 * p.beta4)
    if case == "mass +20 %":
        return p.replace(beta1=p.beta1 / 1.2, beta3=p.beta3 / 1.2)
    return p


def estimate(
    name: str, run: Run, case: str = "", positions: Array | None = None, commands: Array | None = None
) -> Array:
    """Estimates (n, 3) of a configured observer on a run; NaN where its model diverged."""
    kind, parameters = load_variant("observer", name, OBSERVERS)
    model = wrong_model(case, run.table) if OBSERVERS[kind].carries_table else None
    if model is None and hasattr(parameters, "beta1"):
        parameters = wrong_beta(case, parameters)
    observer = Observer(kind, parameters, SAMPLE_TIME, model)
    given = run.measured if positions is None else positions
    try:
        return observer.run(given, run.command if commands is None else commands)
    except ShakeError:
        return np.full((len(given), 3), np.nan)


@njit
def explicit_differentiator(positions, gains, dt, estimates):
    """Levant's differentiator of second order by forward Euler."""
    x, v, a = positions[0], 0.0, 0.0
    for k in range(positions.shape[0]):
        error = positions[k] - x
        root = abs(error) ** (1.0 / 3.0)
        sign = np.sign(error)
        x, v = x + dt * (v + gains[0] * root * root * sign), v + dt * (a + gains[1] * root * sign)
        a += dt * gains[2] * sign
        estimates[k] = x, v, a


@njit
def explicit_sliding_mode(positions, commands, beta, gains, gated, dt, estimates):
    """(6.38), (6.39) by forward Euler; `gated`: a stage is fed once the one before is zero, (5.49)."""
    x, v, a = positions[0], 0.0, 0.0
    for k in range(positions.shape[0]):
        u = commands[k - 1] if k > 0 else 0.0
        first = gains[0] * np.sign(positions[k] - x)
        second = gains[1] * np.sign(first)
        third = gains[2] * np.sign(second)
        if gated and first != 0.0:
            second, third = 0.0, 0.0
        jerk = beta[0] * v + beta[1] * a + beta[2] * u + abs(u) * (beta[3] * a + beta[4] * v)
        x, v, a = x + dt * (v + first), v + dt * (a + second), a + dt * (jerk + third)
        estimates[k] = x, v, a


def forward_euler(name: str, run: Run) -> Array:
    """Estimates of one of the two explicit ones."""
    found = np.empty_like(run.truth)
    if name == "differentiator":
        gains = np.array([g * EXPLICIT_BOUND ** ((i + 1.0) / 3.0) for i, g in enumerate(GAINS[2])])
        explicit_differentiator(run.measured, gains, SAMPLE_TIME, found)
    else:
        _, p = load_variant("observer", "sliding_mode", {"sliding_mode": SlidingModeObserver})
        gains = np.array([p.lambda1, p.lambda2, p.lambda3])
        beta = np.array([p.beta1, p.beta2, p.beta3, p.beta4, p.beta5])
        explicit_sliding_mode(run.measured, run.command, beta, gains, "5.49" in name, SAMPLE_TIME, found)
    return found


def percent(run: Run, found: Array) -> Array:
    """(2,) errors of velocity and acceleration."""
    error: Array = 100.0 * normalised_error(run.truth[FIRST:, 1:], found[FIRST:, 1:])
    return error


def cell(errors: list[Array]) -> str:
    """The worst of several as `velocity/acceleration`."""
    velocity, acceleration = np.max(errors, axis=0)
    if not (velocity < 1000.0 and acceleration < 10_000.0):
        return f"{'diverges':>15s}"
    return f"{velocity:8.2f}/{acceleration:6.1f}"


def standstill(name: str) -> tuple[float, float]:
    """Standard deviation of velocity [mm/s] and acceleration [m/s²] at rest under noise and steps."""
    table = load_table("bergamo").with_values(PLANT)
    samples, step = 6000, table.sensors.position_range / 2**table.sensors.position_bits
    noise = table.sensors.position_noise * np.random.RandomState(7).standard_normal(samples)
    rest = Run("rest", 200.0, table, np.zeros((samples, 3)), np.round(noise / step) * step, np.zeros(samples))
    deviation = estimate(name, rest)[2000:].std(axis=0)
    return 1e3 * float(deviation[1]), float(deviation[2])


def chatter(name: str, run: Run) -> float:
    """Total variation of the acceleration's error per second, without noise and steps [m/s³]."""
    error = (estimate(name, run, positions=np.ascontiguousarray(run.truth[:, 0])) - run.truth)[2000:, 2]
    return float(np.abs(np.diff(error)).mean() / SAMPLE_TIME)


def identified(runs: list[Run], names: list[str]) -> list[str]:
    """The table with the models as identified, and the two explicit ones below."""
    label = "".join(f"{n.removeprefix('earthquake_').replace('sine_', ''):>15s}" for n in names)
    lines = ["as identified, velocity/acceleration [%], largest of 0, 200, 500 kg"]
    lines.append(f"{'observer':28s}{label}{'largest':>10s}{'at standstill':>18s}{'chatter':>11s}")
    lines.append(f"{'':28s}{'':75s}{'v [mm/s]':>10s}{'[mm/s]  [m/s²]':>18s}{'[m/s³]':>11s}")
    sine = next(r for r in runs if r.reference == SINES[0] and r.load == 200.0)
    for name in (*NAMES, "differentiator", "(6.38)", "(6.38) (5.49)"):
        explicit = name not in NAMES
        found = {(r.reference, r.load): (forward_euler(name, r) if explicit else estimate(name, r)) for r in runs}
        cells = "".join(cell([percent(r, found[n, r.load]) for r in runs if r.reference == n]) for n in names)
        worst = [
            np.abs(found[r.reference, r.load] - r.truth)[FIRST:, 1].max() for r in runs if r.reference not in SINES
        ]
        line = f"{f'{name}, forward Euler' if explicit else name:28s}{cells}{min(1e3 * max(worst), 1e6):10.1f}"
        if not explicit:
            velocity, acceleration = standstill(name)
            line += f"{velocity:10.2f}{acceleration:8.3f}{chatter(name, sine):11.1f}"
        lines.append(line)
    return lines


def wrong(runs: list[Run], lacked: dict[str, list[Run]]) -> list[str]:
    """The table of wrong models, worst of records and loads."""
    records = [run for run in runs if run.reference not in SINES]
    cases = ("", "oil -20 %", "valve +20 %", "mass +20 %", "no soft zone")
    lines = ["wrong models, velocity/acceleration [%], largest of three records and three loads (last two: 200 kg)"]
    lines.append(f"{'observer':28s}" + "".join(f"{c or 'as identified':>15s}" for c in (*cases, *lacked)))
    for name in NAMES:
        carries = load_variant("observer", name, OBSERVERS)[1].carries_table
        beta = carries or "beta1" in load_variant("observer", name, OBSERVERS)[1].__dataclass_fields__
        line = f"{name:28s}"
        for case in cases:
            applies = not case or (carries if case == "no soft zone" else beta)
            line += cell([percent(r, estimate(name, r, case)) for r in records]) if applies else f"{'-':>15s}"
        for case, affected in lacked.items():
            line += cell([percent(r, estimate(name, r, case)) for r in affected])
        lines.append(line)
    return lines


def bound(runs: list[Run]) -> str:
    """The best bound on the records, with the noise and the acceleration that occur there."""
    records = [run for run in runs if run.reference not in SINES]
    noise = max(float(np.abs(r.measured - r.truth[:, 0]).max()) for r in records)
    acceleration = max(float(np.abs(r.truth[:, 2]).max()) for r in records)
    best = 1e3 * worst_case(noise, acceleration, SAMPLE_TIME)
    return (
        f"best bound of an exact differentiator on the records: {best:.1f} mm/s "
        f"(N = {1e6 * noise:.0f} um, L = {acceleration:.1f} m/s^2)"
    )


def layers() -> str:
    """The boundary layers within which the two sliding-mode observers have a Kalman filter's gain.

    `sliding_mode_tuned` that of the table's β for a white jerk of 9 m/s^2.5 (it has no state for a disturbance),
    `model_sliding_mode` that of half the table's β.
    """
    _, table = load_variant("observer", "linear_bergamo", {"linear": LinearObserver})
    _, tuned = load_variant("observer", "sliding_mode_tuned", {"sliding_mode": SlidingModeObserver})
    _, p = load_variant("observer", "model_sliding_mode", {"model_sliding_mode": ModelSlidingModeObserver})
    half = {f"beta{i}": 0.5 * getattr(table, f"beta{i}") for i in range(1, 6)}
    chosen = (
        (
            "sliding_mode_tuned",
            {"jerk_noise": 9.0, "disturbance_noise": 1e-3},
            (tuned.lambda1, tuned.lambda2, tuned.lambda3),
        ),
        (
            "model_sliding_mode",
            {**half, "jerk_noise": 0.3, "disturbance_noise": 60.0},
            (p.lambda1, p.lambda2, p.lambda3, p.lambda4),
        ),
    )
    lines = []
    for name, changes, gains in chosen:
        g1, g2, g3, g4 = kalman_gain(table.replace(**changes), SAMPLE_TIME)
        ratios = (SAMPLE_TIME * (1.0 / g1 - 1.0), g1 / g2 - SAMPLE_TIME, g2 / g3 - SAMPLE_TIME, g3 / g4 - SAMPLE_TIME)
        lines += [f"{name}: boundary{i + 1}: {g * r:.4g}" for i, (g, r) in enumerate(zip(gains, ratios, strict=False))]
    return "\n".join([*lines, f"model_sliding_mode: jerk_per_command: {half['beta3']:.4g}"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--save", action="store_true")
    parser.add_argument("--measured", type=Path, metavar="FOLDER")
    parser.add_argument("--layers", action="store_true")
    arguments = parser.parse_args()
    if arguments.layers:
        print(layers())
        return
    began = time.perf_counter()
    chosen = programs(arguments.measured)
    runs = [record_run(name, program, load, {}) for name, program in chosen.items() for load in LOADS]
    records = {name: program for name, program in chosen.items() if name not in SINES}
    lacked = {case: [record_run(*one, 200.0, effects) for one in records.items()] for case, effects in LACKED.items()}
    lines = [*identified(runs, list(chosen)), bound(runs), "", *wrong(runs, lacked)]
    lines.append(f"in {time.perf_counter() - began:.0f} s")
    print("\n".join(lines))
    if arguments.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
