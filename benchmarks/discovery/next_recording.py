"""Does the designed recording settle what a poor first one leaves open? What a study measures.

    ./shake campaign next_recording --out DIR

Tables of hidden_tables.py with declared numbers, and of foreign_tables.py of which nothing is known; neither shares
anything with the package. The first recording is 10 s of a small quake, 6 s to fit and 4 s for validation; one effect
is hidden in each table. From the same first answer, up to two further recordings are made on the hidden table, under
its own loop: of the motion that `next_recording` designs; of the recording of the fixed catalogue that `close_loop`
calls the most helpful; of a motion of the library drawn by chance.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from typing import Any, ClassVar

import numpy as np
from scipy.signal import butter, sosfiltfilt

from benchmarks.discovery import foreign_tables as foreign
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.close_loop import Discovery, close_loop
from shake_ros.api.model import model
from shake_ros.api.read import Recordings, recording
from shake_ros.declared import recordings_to_make
from shake_ros.experiment_design.motions import library
from shake_ros.experiment_design.next_recording import NextRecording, decide, limits_of
from shake_ros.explain.experiments import benefits, drive
from shake_ros.search.verdict import ESTABLISHED, ONE_OF_THESE

SEVERITY = 0.2  # relative change of the acceleration of the first recording by the effect
MOST = 2  # further recordings


def measure(table: str, seed: int, minutes: float, pressures: bool = False) -> dict[str, Any]:
    """One table: the verdict of its first recording, and what each advice makes of it.

    table : declared, or foreign. minutes : of each search on one core.
    pressures : whether the load pressure is measured.
    """
    rng = np.random.default_rng([seed, 45])
    hides, kind = (DeclaredTable, "full") if table == "declared" else (ForeignTable, "unknown")
    effect = str(rng.choice(hides.EFFECTS))
    hidden_table = hides(effect, seed, rng, pressures)
    first, second = hidden_table.quake()
    found = close_loop(model(kind), first, second, minutes=minutes, progress=False)
    before = verdict(found, effect)
    series = [designed(found, hidden_table.again(), minutes)]
    for name, choose in (("fixed", fixed), ("random", drawn)):
        series.append({"advice": name, **chosen(found, hidden_table.again(), effect, minutes, choose)})
    advices = [s | judged(s.pop("found"), effect, before) | {"table": table} for s in series]
    return {"effect": effect, "before": before, "advices": advices}


class HiddenTable(ABC):
    """A hidden table that records, and what its further recordings have asked of it.

    pressures : whether its load pressure is measured. seconds : of excitation. reached : largest position of each [m].
    """

    def __init__(self, seed: int, rng: Any, pressures: bool) -> None:
        self.seed, self.rng, self.pressures = seed, rng, pressures
        self.seconds, self.reached = 0.0, list[float]()

    @property
    @abstractmethod
    def sample_time(self) -> float:
        """Of its recordings [s]."""

    @property
    @abstractmethod
    def limits(self) -> dict[str, float]:
        """What its laboratory allows; empty for a part of what the declared numbers allow."""

    @abstractmethod
    def quake(self) -> tuple[Recordings, Recordings]:
        """The first recording, 10 s of a small quake: 6 s to fit and 4 s for validation."""

    @abstractmethod
    def follow(self, motion: np.ndarray) -> Recordings:
        """One more recording, of a motion that it follows, shape (n, 3)."""

    @abstractmethod
    def excite(self, command: np.ndarray) -> Recordings:
        """One more recording, under a valve command, shape (n,)."""

    def again(self) -> HiddenTable:
        """The same table, of which nothing has been asked."""
        fresh = copy(self)
        HiddenTable.__init__(fresh, self.seed, np.random.default_rng([self.seed, 46]), self.pressures)
        return fresh

    def kept(self, run: Recordings) -> Recordings:
        """A recording, counted."""
        self.seconds += len(run[0].time) * self.sample_time
        self.reached.append(float(np.max(np.abs(run[0].position))))
        return run

    def asked(self, found: Discovery) -> dict[str, Any]:
        """What its further recordings asked of it, where so much was found before."""
        stroke = limits_of(found, self.limits).position
        violations = sum(place > stroke for place in self.reached)
        return {"recordings": len(self.reached), "excitation": self.seconds, "violations": violations}


class DeclaredTable(HiddenTable):
    """Of hidden_tables.py, whose numbers are declared, under its own weak position loop.

    Its effect is so strong that it changes the first recording by SEVERITY where it can.
    """

    EFFECTS = tuple(name for name, kind in hidden.HIDDEN.items() if kind.listed)
    sample_time = hidden.SAMPLE
    limits: ClassVar[dict[str, float]] = {}

    def __init__(self, effect: str, seed: int, rng: Any, pressures: bool) -> None:
        super().__init__(seed, rng, pressures)
        self.command = small_quake(10.0, rng)
        felt = dict.fromkeys(("learn_ladder", "learn_multisine"), self.command)
        self.truth = hidden.with_effect(hidden.declared_truth(seed), effect, SEVERITY, felt, seed)

    def quake(self) -> tuple[Recordings, Recordings]:
        split = round(6.0 / hidden.SAMPLE)
        return self._played("quake_1", self.command[:split]), self._played("quake_2", self.command[split:])

    def follow(self, motion: np.ndarray) -> Recordings:
        return self.excite(np.asarray(motion[:, 1] / self.truth.velocity_gain + hidden.LOOP_GAIN * motion[:, 0]))

    def excite(self, command: np.ndarray) -> Recordings:
        return self.kept(self._played(f"next_{len(self.reached)}", command))

    def _played(self, name: str, excitation: np.ndarray) -> Recordings:
        made = hidden.record(self.truth, excitation, 1.0, self.rng)
        times = np.arange(len(excitation)) * hidden.SAMPLE
        load = {n: made[n] for n in ("pressure_a", "pressure_b") if self.pressures}
        return recording(name, times, made["command"], made["position"], acceleration=made["acceleration"], **load)


class ForeignTable(HiddenTable):
    """Of foreign_tables.py, of which nothing is known, in volts and under its laboratory's loop.

    Its effect has a strength as in the study of unknown tables. It may do what its laboratory's usual tests do.
    """

    EFFECTS = foreign.EFFECTS

    def __init__(self, effect: str, seed: int, rng: Any, pressures: bool) -> None:
        super().__init__(seed, rng, pressures)
        truth = foreign.table(rng)
        bare = foreign.Case(seed, truth, foreign.laboratory(truth, rng), ())
        self.case = foreign.Case(seed, foreign.hide(bare, effect, rng), bare.laboratory, (effect,))

    @property
    def sample_time(self) -> float:
        return 1.0 / self.case.laboratory.rate

    @property
    def limits(self) -> dict[str, float]:
        return foreign.usual(self.case.truth)

    def quake(self) -> tuple[Recordings, Recordings]:
        lab = self.case.laboratory
        wanted = foreign.reference("learn_quake_low", self.case.truth, lab.rate, 10.0, self.rng)
        made = foreign.played(self.case, wanted, self.rng, pressures=self.pressures)
        made.pop("noise")
        split = round(6.0 * lab.rate)
        first, second = ({n: v[part] for n, v in made.items()} for part in (slice(split), slice(split, None)))
        return recording("quake_1", **first), recording("quake_2", **second)

    def follow(self, motion: np.ndarray) -> Recordings:
        made = foreign.played(self.case, motion[:, :2], self.rng, pressures=self.pressures)
        made.pop("noise")
        return self.kept(recording(f"next_{len(self.reached)}", **made))

    def excite(self, command: np.ndarray) -> Recordings:
        velocity = 0.9 * command / self.case.laboratory.feedforward
        position = np.cumsum(velocity) * self.sample_time
        return self.follow(np.column_stack([position, velocity]))


Choice = Callable[[Discovery, HiddenTable], Recordings]  # makes a further recording


def designed(found: Discovery, table: HiddenTable, minutes: float) -> dict[str, Any]:
    """The recordings that `decide` asks for. waited : most processor time from an answer to the next motion [s]."""
    first, waited, answered = found, [0.0], [time.process_time()]

    def play(asked: NextRecording) -> Recordings:
        assert asked.motion is not None
        waited.append(time.process_time() - answered[-1])
        return table.follow(asked.motion)

    decided = decide(
        *(found, play),
        most=MOST,
        minutes=minutes,
        progress=False,
        extended=lambda _: answered.append(time.process_time()),
        limits=table.limits,
    )
    return {"advice": "designed", "found": decided.found, "design": max(waited), **table.asked(first)}


def chosen(found: Discovery, table: HiddenTable, effect: str, minutes: float, choose: Choice) -> dict[str, Any]:
    """Recordings by another advice, until all that is found is established."""
    first = found
    for _ in range(MOST):
        if verdict(found, effect) in ("right", "wrong"):
            break
        found = found.extended(choose(found, table), minutes=minutes, progress=False)
    return {"found": found, **table.asked(first)}


def fixed(found: Discovery, table: HiddenTable) -> Recordings:
    """The most helpful recording of the catalogue that needs no payload."""
    assert found.diagnosis is not None
    candidates = [c for c in recordings_to_make() if not c.payload]
    best = benefits(found.final.fit, found.diagnosis.identifiability, found.estimation, candidates)[0].candidate
    return table.excite(drive(best, max(len(r.commands) for r in found.estimation), table.sample_time))


def drawn(found: Discovery, table: HiddenTable) -> Recordings:
    """A motion of the library by chance."""
    motions = library()
    motion = motions[table.rng.integers(len(motions))]
    return table.follow(motion.samples(limits_of(found, table.limits), table.sample_time))


def judged(found: Discovery, effect: str, before: str) -> dict[str, Any]:
    """What became of the first answer. settled, several, wrong : of one that established nothing, what is now."""
    after, unsettled = verdict(found, effect), before not in ("right", "wrong")
    settled, several, wrong = (after == state if unsettled else None for state in ("right", "several", "wrong"))
    return {"before": before, "after": after, "settled": settled, "several": several, "wrong": wrong}


def small_quake(seconds: float, rng: Any) -> np.ndarray:
    """Valve command of a small quake, at most 6 % of the full one, shape (n,)."""
    n = round(seconds / hidden.SAMPLE)
    time_ = np.arange(n) * hidden.SAMPLE
    band = butter(2, [0.5, 8.0], "bandpass", fs=1.0 / hidden.SAMPLE, output="sos")
    wave = sosfiltfilt(band, rng.standard_normal(n)) * (time_ / 2.5) * np.exp(1.0 - time_ / 2.5)
    wave[n // 2 :] += sosfiltfilt(band, rng.standard_normal(n - n // 2))
    return np.asarray(0.06 * wave / np.max(np.abs(wave)))


def verdict(found: Discovery, effect: str) -> str:
    """Right or wrong where everything found is established; nothing where nothing shows; else open.

    Several where the effect is one of those that explain the recordings equally well.
    """
    states = {v.state for v in found.closed.verdicts}
    if not states and not found.closed.candidates and not found.remaining.above_noise:
        return "nothing"
    if states == {ESTABLISHED} and not found.closed.candidates:
        return "right" if found.effects.names == (effect,) else "wrong"
    if states == {ONE_OF_THESE} and not found.closed.candidates:
        (first, *others) = found.closed.verdicts
        return "several" if not others and effect in (first.effect, *first.alternatives) else "open"
    return "open"
