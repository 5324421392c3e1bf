"""Does the designed recording settle what a poor first one leaves open? What a study measures.

    ./shake campaign next_recording --out DIR

Declared tables of hidden_tables.py, which shares nothing with the package; one effect hidden in each; the first
recording is 10 s of a small quake, 6 s to fit and 4 s for validation. Up to two further recordings are made on the
hidden table, under its own weak position loop: of the motion that `next_recording` designs, or of one of the same
library drawn by chance.
"""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.close_loop import Discovery, close_loop
from shake_ros.api.model import model
from shake_ros.api.read import Recordings, recording
from shake_ros.core.discovery.verdict import ESTABLISHED
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import NextRecording, decide, next_recording

SEVERITY = 0.2  # relative change of the acceleration by the effect
MOST = 2  # further recordings


def measure(seed: int, advice: str, minutes: float) -> dict[str, Any]:
    """One table: the verdict before and after, and what the recordings asked of the table.

    advice : "designed" or "random". minutes : of each search on one core.
    """
    rng = np.random.default_rng([seed, 45])
    listed = [name for name, kind in hidden.HIDDEN.items() if kind.listed]
    effect = str(rng.choice(listed))
    table = hidden.with_effect(hidden.declared_truth(seed), effect, SEVERITY, hidden.excitations(seed), seed)

    def played(name: str, excitation: np.ndarray) -> Recordings:
        made = hidden.record(table, excitation, 1.0, rng)
        times = np.arange(len(excitation)) * hidden.SAMPLE
        return recording(name, times, made["command"], made["position"], acceleration=made["acceleration"])

    whole = quake(10.0, rng)
    split = round(6.0 / hidden.SAMPLE)
    first, second = played("quake_1", whole[:split]), played("quake_2", whole[split:])
    found = close_loop(model("full"), first, second, minutes=minutes, progress=False)
    before = verdict(found, effect)
    gain = table.flow * np.sqrt(0.5 * (table.supply - table.tank)) / table.area
    reached = list[tuple[float, float]]()

    def play(asked: NextRecording) -> Recordings:
        samples = asked.motion if advice == "designed" else drawn(asked, rng)
        assert samples is not None
        run = played(f"next_{len(reached)}", samples[:, 1] / gain + hidden.LOOP_GAIN * samples[:, 0])
        reached.append((len(samples) * hidden.SAMPLE, np.max(np.abs(run[0].position)) / asked.limits.position))
        return run

    began = time.perf_counter()
    next_recording(found, progress=False)
    design = time.perf_counter() - began
    decided = decide(found, play, most=MOST, minutes=minutes, progress=False)
    after = verdict(decided.found, effect)
    return {
        "effect": effect,
        "before": before,
        "after": after,
        "settled": after == "right" if before == "open" else None,
        "wrong_names": sum(name != effect for name in decided.found.effects.names),
        "recordings": len(reached),
        "excitation": sum(seconds for seconds, _ in reached),
        "violations": sum(part > 1.0 for _, part in reached),
        "design_seconds": design,
    }


def quake(seconds: float, rng: Any) -> np.ndarray:
    """Valve command of a small quake, at most 6 % of the full one, shape (n,)."""
    n = round(seconds / hidden.SAMPLE)
    time_ = np.arange(n) * hidden.SAMPLE
    band = butter(2, [0.5, 8.0], "bandpass", fs=1.0 / hidden.SAMPLE, output="sos")
    wave = sosfiltfilt(band, rng.standard_normal(n)) * (time_ / 2.5) * np.exp(1.0 - time_ / 2.5)
    wave[n // 2 :] += sosfiltfilt(band, rng.standard_normal(n - n // 2))
    return np.asarray(0.06 * wave / np.max(np.abs(wave)))


def drawn(asked: NextRecording, rng: Any) -> np.ndarray:
    """A motion of the library by chance, as long as the one that was designed."""
    assert asked.prediction is not None
    motions = library()
    motion = dataclasses.replace(motions[rng.integers(len(motions))], seconds=asked.prediction.motion.seconds)
    return motion.samples(asked.limits, asked.sample_time)


def verdict(found: Discovery, effect: str) -> str:
    """Right or wrong where everything found is established; else open."""
    states = {v.state for v in found.closed.verdicts}
    if not states and not found.closed.candidates and not found.remaining.above_noise:
        return "nothing"
    if states == {ESTABLISHED} and not found.closed.candidates:
        return "right" if found.effects.names == (effect,) else "wrong"
    return "open"
