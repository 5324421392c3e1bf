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
from shake_ros.control.reference.baseline import states_from_rest
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.qualification.asked import Asked, QualificationSettings, asked_of, released
from shake_ros.qualification.assessment import Tested, tested
from shake_ros.qualification.motion import corrected_drive, demand, refusal, synthesise
from shake_ros.qualification.required import RequiredSpectrum
from shake_ros.qualification.resonance import ResonanceSearch, search_motion
from shake_ros.qualification.result import Qualification, searched_in
from shake_ros.quantities import ShakeError
from shake_ros.recordings.accelerograms import read_accelerogram
from shake_ros.recordings.accelerograms.accelerogram import Accelerogram
from shake_ros.recordings.bags import TableRecording

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
        loop, made = self.settings.loop, self.own
        observer, controller = (
            (loop.observer, loop.controller)
            if made is None
            else made.of(model, loop.sample_time, self.delay * loop.sample_time)
        )
        try:
            run: Simulation = simulate(
                self.plant,
                drive,
                loop.sample_time,
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
    scale : factor on the required levels [-].
    table : the simulated table.
    set : values to change in the simulated table, by dotted name or its last part.
    model : the identified table of the feedforward and the observer; the table as declared where not given.
    rules : a name of config/qualification_rules or a file; the spectrum's own where not given.
    settings : config/qualification/NAME.yaml or a file.
    record : accelerogram to start from, or its file, in place of random phases.
    refit : fit the model, with these effects, to each run that does not pass, instead of correcting the drive.
    runs : most runs; those of the settings where not given.
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
        motion = made_motion(asked, seed, record)
        own = own_loop(asked.model) if asked.makes_loop else None
        words = described(asked, motion)
        bar(words, 0.0)
        if live is None:
            laboratory: Laboratory = SimulatedLaboratory(asked.table, asked.settings, delay, seed, own, [])
        else:
            asked = released(asked, live, own, words, release)
            laboratory = LiveLaboratory(live, own, delay * asked.sample_time)
        return conduct(asked, laboratory, motion, seed, bar)


def made_motion(asked: Asked, seed: int, record: str | Path | Accelerogram | None = None) -> Array:
    """The first drive of a test, (n, 3); ShakeError where it does not fit the table."""
    start = _record(record, asked.sample_time)
    acceleration = synthesise(asked.required, asked.table, asked.motion, asked.sample_time, seed, start)
    motion = states_from_rest(acceleration, asked.sample_time)
    why = refusal(motion, asked.table, asked.motion)
    if why:
        raise ShakeError(f"{asked.required.name}: {why}")
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
    made, reason = _runs(asked, laboratory, motion, bar)
    after = _search(asked, laboratory, "search_after", seed) if searches[1] else None
    when = datetime.now(timezone.utc).isoformat(timespec="seconds")
    loop = f"{laboratory.words}, {1e-3 / asked.sample_time:g} kHz"
    return Qualification(
        required=asked.required,
        rules=asked.rules,
        runs=tuple(made),
        reason=reason,
        sample_time=asked.sample_time,
        about={**asked.about, "loop": loop, **laboratory.remarks, "date": when},
        recordings=tuple(laboratory.recordings),
        before=before,
        after=after,
        shift=asked.settings.search.shift,
        per_octave=asked.motion.per_octave,
        search=asked.band,
    )


def described(asked: Asked, states: Array) -> str:
    """Peaks of a motion and what it uses of the table, in words."""
    x, v, a = np.max(np.abs(states), axis=0)
    used = demand(states, asked.table, asked.motion)
    name, share = max(zip(used._fields, used, strict=True), key=lambda item: item[1])
    text = f"motion: {a:.2f} m/s², {v:.3f} m/s, {1e3 * x:.1f} mm at most"
    return f"{text}; {100.0 * share:.0f} % of the {name} that the table may use"


def _runs(
    asked: Asked, laboratory: Laboratory, motion: Array, bar: Callable[[str, float], None]
) -> tuple[list[Tested], str]:
    """Run after run, at least one, and why the last one did not pass; empty where it did.

    Between runs the drive is corrected, or the model fitted to the newest recording.
    """
    step, p = asked.sample_time, asked.settings.running
    made, drive, model = list[Tested](), motion, asked.model
    while True:
        number = len(made) + 1
        recorded = laboratory.play(model, drive, f"run_{number}", number - 1)
        if recorded.acceleration is None:
            raise ShakeError(f"{recorded.name}: no topic imu")
        run = tested(drive, recorded.acceleration, step, asked.required, asked.rules, asked.motion.per_octave)
        made.append(run)
        ratio, passed = run.assessment.ratio, run.assessment.passed
        text = f"run {number}: spectrum missed by {100.0 * run.error:.1f} %, TRS/RRS {ratio.min():.3f} to"
        bar(f"{text} {ratio.max():.3f}, {'passed' if passed else 'not passed'}", number / (p.runs + 1))
        if passed:
            return made, ""
        reason = given_up(asked, [one.error for one in made], float(np.max(np.abs(recorded.position))))
        if reason:
            return made, f"{reason}; what fails: {run.assessment.failing}"
        if asked.learn is not None:
            command, position = recorded.valve_command, recorded.position
            model = asked.learn(model, [Record(recorded.name, step, command, position, recorded.acceleration)])
            continue
        peak = float(np.max(np.abs(run.motion)))
        following = corrected_drive(drive[:, 2], run.matched, peak, asked.required, asked.motion, step, p.gain)
        drive = states_from_rest(following, step)
        used = max(demand(drive, asked.table, asked.motion))
        if used > 1.0:
            return made, f"the next drive would need {used:.2f} times what the table may use"


def given_up(asked: Asked, errors: list[float], position: float) -> str:
    """Why no further run is made; empty where one is."""
    p, stop = asked.settings.running, 0.5 * asked.table.value("body.stroke")
    if position >= p.near_limit * stop:
        return f"the table reached {1e3 * position:.0f} mm, the end stops are at {1e3 * stop:.0f} mm"
    if len(errors) >= 3 and errors[-1] > p.growth * errors[-2] and errors[-2] > p.growth * errors[-3]:
        listed = ", ".join(f"{100.0 * e:.1f}" for e in errors)
        return f"the spectrum's error grew twice ({listed} % rms of the logarithm)"
    if len(errors) < p.runs:
        return ""
    return f"not passed after {len(errors)} {'run' if len(errors) == 1 else 'runs'}"


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
    drive = search_motion(asked.settings.search, asked.sample_time, seed)
    used = max(demand(drive, asked.table, asked.motion))
    if used > 1.0:
        raise ShakeError(f"search: its motion needs {used:.2f} times what the table may use")
    return searched_in(laboratory.play(asked.model, drive, name, 500 + len(laboratory.recordings)), asked.band)
