"""The motion library beside reqpy-M: python -m benchmarks.qualification.against_reqpy [--seeds N] [--save].

The same seed records, random phases under the envelope, are matched by `matched` of shake_ros and by reqpy-M 0.4.1
(L. A. Montejo, MIT licence, June 2026; continuous wavelets, baseline of sixth order; `pip install --no-deps reqpy-M`),
to the same target at the same damping. The spectra of both are taken by the oscillators of shake_ros at 100
frequencies a decade: rms of ln(found/target), lowest and largest of it; peak displacement and the displacement that is
left at the end, by exact integration; processor time. --save writes benchmarks/qualification/against_reqpy.txt.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.qualification.identified import CASES
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.qualification.asked import load_rules, load_settings
from shake_ros.qualification.motion import MotionParameters, aimed, matched, random_phases, rough
from shake_ros.qualification.required import GRAVITY, RequiredSpectrum, load_required
from shake_ros.signals.response_spectrum import response_spectrum

Array = NDArray[np.float64]
STEP, PER_DECADE = 0.004, 100


def ours(record: Array, required: RequiredSpectrum, parameters: MotionParameters) -> Array:
    """By amplitudes and wavelets of this program."""
    return matched(rough(record, STEP, required, parameters), STEP, required, parameters)


def theirs(record: Array, required: RequiredSpectrum, parameters: MotionParameters) -> Array:
    """By reqpy-M, which takes accelerations in g."""
    import reqpy_M

    f, levels = aimed(required, parameters.per_octave, parameters.aim, parameters.aim_last)
    periods, target = 1.0 / f[::-1], levels[::-1] / GRAVITY
    ends = 1.0 / required.frequencies[-1], 1.0 / required.frequencies[0]
    with contextlib.redirect_stdout(io.StringIO()):
        found = reqpy_M.generate_single_component_compatible_record(
            record / GRAVITY, 1.0 / STEP, periods, target, T1PSA=ends[0], T2PSA=ends[1], zi=required.damping
        )
    return np.asarray(found["sc"], dtype=np.float64) * GRAVITY


def line(name: str, motion: Array, seconds: float, required: RequiredSpectrum, parameters: MotionParameters) -> str:
    """What a motion came to."""
    lowest, highest = required.frequencies[[0, -1]]
    f = np.geomspace(lowest, highest, round(PER_DECADE * np.log10(highest / lowest)))
    at, levels = aimed(required, parameters.per_octave, parameters.aim, parameters.aim_last)
    target = np.exp(np.interp(np.log(f), np.log(at), np.log(levels)))
    found = response_spectrum(motion, STEP, f, required.damping, band_limited=True)
    ratio = np.abs(found.acceleration) / target
    position = 1e3 * states_from_rest(motion, STEP)[:, 0]
    return (
        f"{name:10s} spectrum missed {100.0 * np.sqrt(np.mean(np.log(ratio) ** 2)):5.1f} %, {ratio.min():.3f} to "
        f"{ratio.max():.3f}; {np.max(np.abs(motion)):.2f} m/s², {np.max(np.abs(position)):6.1f} mm at most, "
        f"{position[-1]:8.3f} mm left; {seconds:5.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    lines = []
    for name, scale in CASES:
        found, rules = load_required(name)
        required, parameters = found.scaled(scale), load_settings("default").motion_for(load_rules(rules))
        for seed in range(given.seeds):
            record = random_phases(required, parameters, STEP, seed)
            for who, make in (("shake_ros", ours), ("reqpy-M", theirs)):
                began = time.process_time()
                motion = make(record, required, parameters)
                spent = time.process_time() - began
                lines.append(f"{name:8s} seed {seed}  {line(who, motion, spent, required, parameters)}")
                print(lines[-1], flush=True)
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
