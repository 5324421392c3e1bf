"""Does the designed recording settle what a poor first one leaves open? What a study measures.

    ./shake campaign next_recording --out DIR

Declared tables of hidden_tables.py, which shares nothing with the package; the first recording is 10 s of a small
quake, 6 s to fit and 4 s for validation; one effect is hidden in each table, so strong that it changes the acceleration
of this recording by SEVERITY where it can. From the same first answer, up to two further
recordings are made on the hidden table, under its own weak position loop: of the motion that `next_recording` designs;
of the recording of the fixed catalogue that `close_loop` calls the most helpful; of a motion of the library drawn by
chance.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.close_loop import close_loop
from shake_ros.api.discovery import Discovery
from shake_ros.api.model import model
from shake_ros.api.read import Recordings, recording
from shake_ros.core.discovery.verdict import ESTABLISHED
from shake_ros.core.identification.experiments import benefits, drive
from shake_ros.declared import recordings_to_make
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import NextRecording, decide, limits_of

SEVERITY = 0.2  # relative change of the acceleration of the first recording by the effect
MOST = 2  # further recordings
Choice = Callable[[Discovery, Any], np.ndarray]  # excitation of a further recording, shape (n,)


def measure(seed: int, minutes: float) -> dict[str, Any]:
    """One table: the verdict of its first recording, and what each advice makes of it.

    minutes : of each search on one core.
    """
    rng = np.random.default_rng([seed, 45])
    listed = [name for name, kind in hidden.HIDDEN.items() if kind.listed]
    effect = str(rng.choice(listed))
    quake = small_quake(10.0, rng)
    felt = dict.fromkeys(("learn_ladder", "learn_multisine"), quake)
    truth = hidden.with_effect(hidden.declared_truth(seed), effect, SEVERITY, felt, seed)
    table, split = HiddenTable(truth, rng), round(6.0 / hidden.SAMPLE)
    first, second = table.played("quake_1", quake[:split]), table.played("quake_2", quake[split:])
    found = close_loop(model("full"), first, second, minutes=minutes, progress=False)
    before = verdict(found, effect)
    series = [designed(found, HiddenTable(truth, np.random.default_rng([seed, 46])), minutes)]
    for name, choose in (("fixed", fixed), ("random", drawn)):
        table = HiddenTable(truth, np.random.default_rng([seed, 46]))
        series.append({"advice": name, **chosen(found, table, effect, minutes, choose)})
    return {"effect": effect, "before": before, "advices": [s | judged(s.pop("found"), effect, before) for s in series]}


@dataclass
class HiddenTable:
    """A hidden table that records, and what its further recordings have asked of it.

    seconds : of excitation. reached : largest position of each [m].
    """

    truth: hidden.Truth
    rng: Any
    seconds: float = 0.0
    reached: list[float] = field(default_factory=list)

    def played(self, name: str, excitation: np.ndarray) -> Recordings:
        """A recording under the table's weak position loop."""
        made = hidden.record(self.truth, excitation, 1.0, self.rng)
        times = np.arange(len(excitation)) * hidden.SAMPLE
        return recording(name, times, made["command"], made["position"], acceleration=made["acceleration"])

    def further(self, excitation: np.ndarray) -> Recordings:
        """One more recording."""
        run = self.played(f"next_{len(self.reached)}", excitation)
        self.seconds += len(excitation) * hidden.SAMPLE
        self.reached.append(float(np.max(np.abs(run[0].position))))
        return run

    def following(self, motion: np.ndarray) -> np.ndarray:
        """Excitation under which the table about follows a motion, shape (n, 3) → (n,)."""
        t = self.truth
        gain = t.flow * np.sqrt(0.5 * (t.supply - t.tank)) / t.area
        return np.asarray(motion[:, 1] / gain + hidden.LOOP_GAIN * motion[:, 0])

    def asked(self, stroke: float) -> dict[str, Any]:
        """What its further recordings asked of it; stroke : how far they may go [m]."""
        violations = sum(place > stroke for place in self.reached)
        return {"recordings": len(self.reached), "excitation": self.seconds, "violations": violations}


def designed(found: Discovery, table: HiddenTable, minutes: float) -> dict[str, Any]:
    """The recordings that `decide` asks for. waited : most processor time from an answer to the next motion [s]."""
    stroke, waited, answered = limits_of(found).position, [0.0], [time.process_time()]

    def play(asked: NextRecording) -> Recordings:
        assert asked.motion is not None
        waited.append(time.process_time() - answered[-1])
        return table.further(table.following(asked.motion))

    decided = decide(
        found, play, most=MOST, minutes=minutes, progress=False, extended=lambda _: answered.append(time.process_time())
    )
    return {"advice": "designed", "found": decided.found, "design": max(waited), **table.asked(stroke)}


def chosen(found: Discovery, table: HiddenTable, effect: str, minutes: float, choose: Choice) -> dict[str, Any]:
    """Recordings by another advice, until all that is found is established."""
    stroke = limits_of(found).position
    for _ in range(MOST):
        if verdict(found, effect) in ("right", "wrong"):
            break
        found = found.extended(table.further(choose(found, table)), minutes=minutes, progress=False)
    return {"found": found, **table.asked(stroke)}


def fixed(found: Discovery, _: HiddenTable) -> np.ndarray:
    """The most helpful recording of the catalogue that needs no payload."""
    assert found.diagnosis is not None
    candidates = [c for c in recordings_to_make() if not c.payload]
    best = benefits(found.final.fit, found.diagnosis.identifiability, found.estimation, candidates)[0].candidate
    return drive(best, max(len(r.commands) for r in found.estimation), hidden.SAMPLE)


def drawn(found: Discovery, table: HiddenTable) -> np.ndarray:
    """A motion of the library by chance."""
    motions = library()
    motion = motions[table.rng.integers(len(motions))]
    return table.following(motion.samples(limits_of(found), hidden.SAMPLE))


def judged(found: Discovery, effect: str, before: str) -> dict[str, Any]:
    """What became of the first answer. settled, wrong : of one that established nothing, what is now; else None."""
    after, unsettled = verdict(found, effect), before in ("open", "nothing")
    settled, wrong = (after == state if unsettled else None for state in ("right", "wrong"))
    return {"before": before, "after": after, "settled": settled, "wrong": wrong}


def small_quake(seconds: float, rng: Any) -> np.ndarray:
    """Valve command of a small quake, at most 6 % of the full one, shape (n,)."""
    n = round(seconds / hidden.SAMPLE)
    time_ = np.arange(n) * hidden.SAMPLE
    band = butter(2, [0.5, 8.0], "bandpass", fs=1.0 / hidden.SAMPLE, output="sos")
    wave = sosfiltfilt(band, rng.standard_normal(n)) * (time_ / 2.5) * np.exp(1.0 - time_ / 2.5)
    wave[n // 2 :] += sosfiltfilt(band, rng.standard_normal(n - n // 2))
    return np.asarray(0.06 * wave / np.max(np.abs(wave)))


def verdict(found: Discovery, effect: str) -> str:
    """Right or wrong where everything found is established; nothing where nothing shows; else open."""
    states = {v.state for v in found.closed.verdicts}
    if not states and not found.closed.candidates and not found.remaining.above_noise:
        return "nothing"
    if states == {ESTABLISHED} and not found.closed.candidates:
        return "right" if found.effects.names == (effect,) else "wrong"
    return "open"
