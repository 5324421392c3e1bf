"""Does the loop track again once the followed values are released to it?

    python -m benchmarks.twin.release [--save]

A simulated table with sensor noise plays random motions; from the fourth on it has a fault. Beside the loop as it was
made, the same loop gets what the twin follows, between two motions. The errors are of the
acceleration behind its reference, the last two motions' mean.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import shake_ros as sr
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.runner import Controller
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.runner import Observer
from shake_ros.control.reference.motion import smooth_step
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_table, load_variant
from shake_ros.twin.followed import TwinSettings, load_twin
from shake_ros.twin.page import asks_for_action
from shake_ros.twin.release import Release, for_table
from shake_ros.twin.twin import WATCHING, Twin

DT = 1e-3
SECONDS, BAND, SIZE = 8.6, (0.7, 8.0), 1.5  # of a motion [s], [Hz], [m/s²]
SOUND, FAULTY = 3, 4  # motions before and with the fault
FACTOR, TIME = 1.5, 2.0  # of the node's configuration
FAULTS = {
    "flow gain −20 %": {"valve.flow_coefficient": 0.8},
    "supply pressure −20 %": {"supply.supply_pressure": 0.8},
}
LOOPS = {
    "three variables with a model, fused observer": ("three_variable_tuned", "fused_accelerometer", True),
    "feedforward PI, linear observer": ("feedforward_pi_tuned", "linear_bergamo", False),
}


def loop(names: tuple[str, str, bool], file: TableParameters, now: TableParameters) -> tuple[Observer, Controller]:
    """Observer and controller made for the table of a file, as they are for the table now."""
    controller, observer, carries = names
    kind, law = load_variant("controller", controller, CONTROLLERS)
    sort, watched = load_variant("observer", observer, OBSERVERS)
    law = law.replace(**for_table(law, file, now), model="given" if carries else "")
    watched = watched.replace(**for_table(watched, file, now))
    return Observer(sort, watched, DT, now), Controller(kind, law, DT, now if carries else None)


def motion(seed: int) -> np.ndarray:
    """A random motion from rest to rest with its derivatives, (n, 3) [m], [m/s], [m/s²]."""
    rng, t = np.random.default_rng(seed), np.arange(round(SECONDS / DT)) * DT
    omega = 2.0 * np.pi * np.arange(*BAND, 1.0 / SECONDS)[:, None]
    phases = rng.uniform(0.0, 2.0 * np.pi, omega.shape)
    position = np.sum(np.cos(omega * t + phases) / omega**2, axis=0) * smooth_step(np.minimum(t, t[-1] - t))[0]
    velocity = np.gradient(position, DT)
    acceleration = np.gradient(velocity, DT)
    return np.column_stack([position, velocity, acceleration]) * SIZE / np.std(acceleration)


def motions(
    names: tuple[str, str, bool], factors: dict[str, float], settings: TwinSettings, released: bool
) -> Iterator[tuple[float, Release]]:
    """Tracking error of each motion, and what the loop has of the followed values in it."""
    file = load_table("bergamo")
    faulty = file.with_values({n: f * file.value(n) for n, f in factors.items()})
    twin = Twin(file, settings, DT)
    release, sound = Release(twin, FACTOR, TIME), True
    for k in range(SOUND + FAULTY):
        observer, controller = loop(names, file, file.with_values(release.changes))
        table = file if k < SOUND else faulty
        run = sr.simulate(table, motion(k), DT, controller=controller, observer=observer, seed=k)
        yield float(run.error["error"][2]), release
        r = run.recording
        assert r.acceleration is not None
        twin.begin(str(k))
        stamps = np.rint((1.0 + 20.0 * k + r.time) * 1e9).astype(np.int64)
        for w in twin.add(stamps, r.valve_command, r.position, r.acceleration) if released else ():
            sound = sound and not (w.change and asks_for_action(w.change))
            if sound and w.state == WATCHING:
                release.know(w)
                release.step(settings.test.window, on=True)


def main() -> None:
    """Print a line for each loop and fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--save", action="store_true", help="keep the lines in release.txt")
    given, settings, lines = parser.parse_args(), load_twin(), list[str]()
    for title, names in LOOPS.items():
        lines += [
            title,
            f"{'fault':24s}{'before':>9s}{'with it':>9s}{'released':>9s}  in the loop, of the file's value",
        ]
        for fault, factors in FAULTS.items():
            without = [e for e, _ in motions(names, factors, settings, released=False)]
            run = list(motions(names, factors, settings, released=True))
            release = run[-1][1]
            means = without[SOUND - 1], np.mean(without[-2:]), np.mean([e for e, _ in run[-2:]])
            file = dict(zip(release.names, release.file, strict=True))
            now = ", ".join(f"{n} {v / file[n]:.3f}" for n, v in release.changes.items() if file[n])
            lines.append(f"{fault:24s}" + "".join(f"{100.0 * m:7.1f} %" for m in means) + f"  {now or 'unchanged'}")
            print(lines[-1], flush=True)
        lines.append("")
    print("\n".join(lines))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
