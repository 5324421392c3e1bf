"""`qualify`: from a required response spectrum to the certificate, on a simulated table or that of a running graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import FUSED, LiveLaboratory, LiveTable, OwnLoop, Release, own_loop
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.simulate import Simulation, simulate
from shake_ros.core.control.runner import Controller
from shake_ros.core.identification.recordings import Record
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.baseline import states_from_rest
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.accelerograms.accelerogram import Accelerogram
from shake_ros.data.recordings import TableRecording
from shake_ros.iteration.iterate import Learn
from shake_ros.qualification.asked import (
    Asked,
    QualificationSettings,
    Test,
    Tested,
    asked_of,
    iterate_test,
    released,
)
from shake_ros.qualification.motion import Demand, demand, refusal, synthesise
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.qualification.resonance import ResonanceSearch, search_motion
from shake_ros.qualification.result import Qualification, searched_in

Array = NDArray[np.float64]


class Laboratory(Protocol):
    """What plays and records a drive."""

    @property
    def words(self) -> str:
        """Its loop, for the certificate."""

    @property
    def remarks(self) -> dict[str, str]:
        """What the certificate says of it beyond that, by name."""

    @property
    def recordings(self) -> Sequence[TableRecording]:
        """Of all runs so far."""

    def play(self, model: TableParameters, drive: Array, name: str, number: int, /) -> TableRecording:
        """One recorded run of a drive (n, 3) under a model; `number` selects its noise."""


@dataclass
class SimulatedLaboratory:
    """The simulated table of a test, the loop made for its model where it has one, and the recordings made on it."""

    plant: TableParameters
    settings: QualificationSettings
    delay: int
    seed: int
    own: OwnLoop | None
    recordings: list[TableRecording]

    def loop(self, model: TableParameters) -> tuple[str | Observer, str | Controller]:
        """Observer and controller with a model, or the names of those that take one."""
        loop = self.settings.loop
        if self.own is None:
            return loop.observer, loop.controller
        return self.own.of(model, loop.sample_time, self.delay * loop.sample_time)

    @property
    def words(self) -> str:
        """Controller and observer, for the certificate."""
        loop = self.settings.loop
        if self.own is None:
            return f"{loop.controller}, {loop.observer}"
        warning = "" if self.own.sound else ", which oscillate on a neighbour of it"
        return f"{self.own.kind}, {FUSED}, gains made for the model{warning}"

    @property
    def remarks(self) -> dict[str, str]:
        """None."""
        return {}

    def play(self, model: TableParameters, drive: Array, name: str, number: int) -> TableRecording:
        """One recorded run."""
        observer, controller = self.loop(model)
        try:
            run: Simulation = simulate(
                self.plant,
                drive,
                self.settings.loop.sample_time,
                controller=controller,
                observer=observer,
                model=model,
                delay=self.delay,
                seed=1000 * self.seed + number,
            )
        except ShakeError as error:
            raise ShakeError(f"{name}: {error}") from None
        self.recordings.append(replace(run.recording, name=name))
        return self.recordings[-1]


LAST_SEED, MOST_DELAY = 1_000_000, 1000


def qualify(
    required: str | Path | RequiredSpectrum,
    table: str | Path | TableParameters = "bergamo",
    *,
    model: str | Path | TableParameters | None = None,
    rules: str | None = None,
    scale: float = 1.0,
    set: Mapping[str, float] | None = None,  # noqa: A002 (the command's option has this name)
    settings: str = "default",
    record: str | Path | Accelerogram | None = None,
    refit: Sequence[str] | None = None,
    runs: int | None = None,
    seed: int = 0,
    delay: int = 0,
    specimen: str = "",
    live: LiveTable | None = None,
    release: Release = lambda _: "",
    progress: ProgressOption = True,
) -> Qualification:
    """Make a motion that meets a required spectrum, run it until the test response spectrum passes, and assess it.

    Parameters
    ----------
    required : a name of config/required_spectra, a YAML file, or a spectrum.
    scale : of its levels [-].
    table : the simulated table.
    set : values to change in it, by dotted name or its last part.
    model : the identified table of the feedforward and the observer; the table as declared where not given.
    rules : a name of config/qualification_rules or a file; the spectrum's own where not given.
    record : accelerogram to start from, or its file, in place of random phases.
    refit : fit the model, with these effects, to each run that does not pass, instead of correcting the drive.
    runs : most runs.
    seed : of the phases and the sensors' noise.
    delay : samples by which a command acts late.
    specimen : what is tested, for the certificate.
    live : the table of a running graph, as `shake_ros.ros.live_table.live_table` gives it; `table` then is what is
        declared of it, whose envelope the motion keeps. Its loop stays; with `model` or `refit` gains made for the
        model take its place.
    release : is called with what will move it, and returns who releases it; required.

    Raises
    ------
    ShakeError
        The motion does not fit the table, with the limit, the excess and what would fit; wrong files; a lost loop; a
        live table that is not ready or that its interlock held. NotReleasedError where nobody releases it.
    """
    for name, value, most in (("seed", seed, LAST_SEED), ("delay", delay, MOST_DELAY)):
        if not 0 <= value <= most:
            raise ShakeError(f"{name} = {value} is not within 0 … {most}")
    asked = asked_of(
        required,
        table,
        model=model,
        rules=rules,
        scale=scale,
        set=set,
        settings=settings,
        refit=refit,
        runs=runs,
        specimen=specimen,
        seed=seed,
        live=live,
    )
    with Progress("qualify", progress) as bar:
        bar("making the motion", 0.0)
        motion = made_motion(asked.test, seed, record)
        own = own_loop(asked.model) if asked.makes_loop else None
        words = described(motion, demand(motion, asked.test.table, asked.test.motion))
        bar(words, 0.0)
        if live is None:
            laboratory: Laboratory = SimulatedLaboratory(asked.test.table, asked.settings, delay, seed, own, [])
        else:
            asked = released(asked, live, own, words, release)
            laboratory = LiveLaboratory(live, own, delay * asked.test.sample_time)
        return conduct(asked, laboratory, motion, seed, bar)


def made_motion(test: Test, seed: int, record: str | Path | Accelerogram | None = None) -> Array:
    """The first drive of a test, (n, 3); ShakeError where it does not fit the table."""
    start = _record(record, test.sample_time)
    acceleration = synthesise(test.required, test.table, test.motion, test.sample_time, seed, start)
    motion = states_from_rest(acceleration, test.sample_time)
    why = refusal(motion, test.table, test.motion)
    if why:
        raise ShakeError(f"{test.required.name}: {why}")
    return motion


def conduct(
    asked: Asked,
    laboratory: Laboratory,
    motion: Array,
    seed: int,
    bar: Callable[[str, float], None],
    searches: tuple[bool, bool] = (True, True),
) -> Qualification:
    """Search, runs, search; `searches` : whether there is one before, and one after."""
    before = _search(asked, laboratory, "search_before", seed) if searches[0] else None
    made, reason = _runs(asked.test, laboratory, motion, asked.model, asked.learn, bar)
    after = _search(asked, laboratory, "search_after", seed) if searches[1] else None
    test, step = asked.test, asked.test.sample_time
    when = datetime.now(timezone.utc).isoformat(timespec="seconds")
    about = {**asked.about, "loop": f"{laboratory.words}, {1e-3 / step:g} kHz", **laboratory.remarks, "date": when}
    return Qualification(
        required=test.required,
        rules=test.rules,
        runs=tuple(made),
        reason=reason,
        sample_time=step,
        about=about,
        recordings=tuple(laboratory.recordings),
        before=before,
        after=after,
        shift=asked.settings.search.shift,
        per_octave=test.motion.per_octave,
        search=asked.band,
    )


def described(states: Array, used: Demand) -> str:
    """Peaks of a motion and what it uses of the table, in words."""
    x, v, a = np.max(np.abs(states), axis=0)
    name, share = max(zip(used._fields, used, strict=True), key=lambda item: item[1])
    text = f"motion: {a:.2f} m/s², {v:.3f} m/s, {1e3 * x:.1f} mm at most"
    return f"{text}; {100.0 * share:.0f} % of the {name} that the table may use"


def _runs(
    test: Test,
    laboratory: Laboratory,
    motion: Array,
    model: TableParameters,
    learn: Learn | None,
    bar: Callable[[str, float], None],
) -> tuple[list[Tested], str]:
    """The runs of a test and why they ended."""

    def play(carried: TableParameters, drive: Array, number: int) -> tuple[Array, Array]:
        run = laboratory.play(carried, drive, f"run_{number + 1}", number)
        if run.acceleration is None:
            raise ShakeError(f"{run.name}: no topic imu")
        return run.acceleration, run.position

    def again(carried: TableParameters, _: int) -> TableParameters:
        assert learn is not None
        run = laboratory.recordings[-1]
        return learn(carried, [Record(run.name, run.sample_time, run.valve_command, run.position, run.acceleration)])

    def on_run(number: int, run: Tested) -> None:
        ratio = run.assessment.ratio
        low, high = ratio.min(), ratio.max()
        text = f"run {number}: spectrum missed by {100.0 * run.error:.1f} %, TRS/RRS {low:.3f} to {high:.3f}"
        bar(f"{text}, {'passed' if run.assessment.passed else 'not passed'}", number / (test.running.runs + 1))

    return iterate_test(test, motion, play, model, None if learn is None else again, on_run)


def _record(given: str | Path | Accelerogram | None, step: float) -> Array | None:
    """An accelerogram's acceleration at the loop's sample time."""
    if given is None:
        return None
    found = given if isinstance(given, Accelerogram) else read_accelerogram(Path(given))
    time = np.arange(found.acceleration.size) * found.time_step
    return np.interp(np.arange(0.0, time[-1], step), time, found.acceleration)


def _search(asked: Asked, laboratory: Laboratory, name: str, seed: int) -> ResonanceSearch | None:
    """The resonances that a low motion shows; None without a search or pressures."""
    if asked.settings.search.level == 0.0:
        return None
    test = asked.test
    drive = search_motion(asked.settings.search, test.sample_time, seed)
    used = max(demand(drive, test.table, test.motion))
    if used > 1.0:
        raise ShakeError(f"search: its motion needs {used:.2f} times what the table may use")
    return searched_in(laboratory.play(asked.model, drive, name, 500 + len(laboratory.recordings)), asked.band)
