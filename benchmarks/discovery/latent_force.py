"""How accurate is the force that a model lacks, and up to which frequency? python -m benchmarks.discovery.latent_force.

Tables of hidden_tables.py, a simulator of its own, with a force that the declared model does not have. The declared
model has the table's true numbers, so that nothing but the force is missing: the accuracy is the estimate's alone.
Prints for each force the relative rms error over --seeds tables and two recordings, the same by band of frequency, how
much of the time the 90 % band holds the true force, and what kind the force is told to be.
"""

from __future__ import annotations

import argparse
import collections
import time
from collections.abc import Sequence

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.explain.latent_force import LatentForce, latent_force
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.settings import load_search, load_table

FORCES: dict[str, dict[str, float]] = {
    "nothing": {},
    "constant 500 N": {"constant_force": 500.0},
    "spring to ground 30 kN/m": {"stiffness_to_ground": 3e4},
    "spring to ground 300 kN/m": {"stiffness_to_ground": 3e5},
    "push of 1500 N at one place": {"force_bump": 1500.0},
    "pulses of 200 N, 120 ms": {"pulse_force": 200.0},
    "pulses of 800 N, 120 ms": {"pulse_force": 800.0},
    "pulses of 800 N, 30 ms": {"pulse_force": 800.0, "pulse_length": 0.03},
}
OTHERS: dict[str, dict[str, float]] = {
    "pre-sliding over 0.3 mm": {"presliding_friction": 3e-4},
    "supply pulsation of 10 %": {"supply_pulsation": 0.1},
    "soft zone": {"soft_zone": 0.5},
    "hardening specimen of 60 kg": {"cubic_specimen": 60.0},
    "backlash of 0.3 mm": {"coupling_backlash": 3e-4},
}
BANDS = ((0.0, 1.0), (1.0, 5.0), (5.0, 10.0), (10.0, 20.0), (20.0, 40.0))  # [Hz]
RECORDINGS = ("hold_multisine", "hold_pulses")


def declared_table(truth: hidden.Truth) -> TableParameters:
    """The declared model with the numbers of a table."""
    return load_table("bergamo").with_values({name: getattr(truth, own) for name, own in hidden.DECLARED.items()})


def true_force(truth: hidden.Truth, record: Record) -> np.ndarray:
    """Force of the surroundings from the first sample compared [N]."""
    at = np.arange(len(record.commands)) * record.sample_time
    force = [hidden.ground_force(truth, x, t) for x, t in zip(record.track, at, strict=True)]
    return np.array(force)[record.start :]


def relative_error(force: LatentForce, true: np.ndarray) -> float:
    """rms(estimated − true) / rms(true)."""
    return float(np.sqrt(np.mean((force.force - true) ** 2) / np.mean(true**2)))


def in_band(values: np.ndarray, low: float, high: float) -> float:
    """Rms of what lies between two frequencies [Hz]."""
    edges, kind = ((low, high), "bandpass") if low else (high, "lowpass")
    return float(np.std(sosfiltfilt(butter(3, edges, kind, fs=1.0 / hidden.SAMPLE, output="sos"), values)))


def row(name: str, effects: dict[str, float], seeds: Sequence[int]) -> list[str]:
    """One force over tables and recordings."""
    settings, errors, held, said = load_search(), [], [], collections.Counter[str]()
    bands, left, rms, seconds = [], [], [], 0.0
    for seed in seeds:
        base = hidden.declared_truth(seed)
        truth, table = base._replace(**effects), declared_table(base)
        for which in RECORDINGS:
            made = hidden.record(truth, hidden.excitations(seed)[which], 1.0, np.random.default_rng(seed))
            record = Record(which, hidden.SAMPLE, made["command"], made["position"], made["acceleration"])
            start = time.process_time()
            force = latent_force(FULL, table, record, settings)
            seconds += time.process_time() - start
            if force is None:
                said["lost"] += 1
                continue
            said[force.kinds.text] += 1
            rms.append(force.rms)
            left.append(force.left)
            if name in OTHERS:
                continue
            true = true_force(truth, record)
            low, high = force.ends
            held.append(float(np.mean((low < true) & (true < high))))
            if effects:
                errors.append(relative_error(force, true))
                bands.append([(in_band(force.force - true, *b), in_band(true, *b)) for b in BANDS])
    cells = [f"{np.mean(rms):.0f} N", f"{np.mean(left, axis=0)[0]:.2f} → {np.mean(left, axis=0)[1]:.2f}"]
    cells.append(f"{100.0 * np.mean(errors):.0f} %" if errors else "")
    for wrong, size in np.sqrt(np.mean(np.square(bands), axis=0)) if bands else ():
        cells.append(f"{wrong:.0f} / {size:.0f}")
    cells += [""] * (3 + len(BANDS) - len(cells))
    cells.append(f"{100.0 * np.mean(held):.0f} %" if held else "")
    cells.append(f"{1e3 * seconds / max(len(rms), 1):.0f} ms")
    return [name, *cells, "; ".join(f"{count} × {text}" for text, count in said.most_common(3))]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6, help="tables of each force")
    seeds = range(1, parser.parse_args(arguments).seeds + 1)
    latent_force(FULL, declared_table(hidden.declared_truth(0)), _first(), load_search())  # compiles
    heads = ["force", "estimate", "× noise", "error", *(f"{a:g}–{b:g} Hz" for a, b in BANDS), "in band", "takes"]
    widths = [28, 9, 15, 7, 11, 11, 11, 11, 11, 8, 8]
    print(
        "relative rms error; rms of the error / rms of the force by band of frequency [N]; true force within the band"
    )
    print("".join(head.ljust(width) for head, width in zip(heads, widths, strict=True)).rstrip())
    for name, effects in {**FORCES, **OTHERS}.items():
        *cells, text = row(name, effects, seeds)
        print("".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
        print(f"    {text}", flush=True)


def _first() -> Record:
    made = hidden.record(
        hidden.declared_truth(0), hidden.excitations(0)["hold_pulses"][:1500], 1.0, np.random.default_rng(0)
    )
    return Record("first", hidden.SAMPLE, made["command"], made["position"], made["acceleration"])


if __name__ == "__main__":
    main()
