"""`qualify`: from a required response spectrum to the certificate, on a simulated table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.iterate import Learn, learning
from shake_ros.api.own_loop import FUSED, OwnLoop, own_loop
from shake_ros.api.progress import Progress, Told
from shake_ros.api.qualification import Qualification, searched_in
from shake_ros.api.qualification_files import (
    QualificationSettings,
    SearchParameters,
    load_required,
    load_rules,
    load_settings,
)
from shake_ros.api.simulate import Simulation, simulate
from shake_ros.core.control.runner import Controller
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.drive import integrate
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.qualification.motion import REST, Demand, check_sampling, demand, refusal, synthesise
from shake_ros.core.qualification.required import RequiredSpectrum
from shake_ros.core.qualification.resonance import Resonance, SearchBand
from shake_ros.core.qualification.run import Test, Tested, iterate_test
from shake_ros.core.quantities import ShakeError
from shake_ros.core.reference.baseline import end_at_rest, filtered
from shake_ros.core.reference.motion import smooth_step
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.data.recordings import TableRecording
from shake_ros.settings import load_table

Array = NDArray[np.float64]
LAST_SEED, MOST_DELAY = 1_000_000, 1000


@dataclass
class _Laboratory:
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
        told = "" if self.own.sound else ", which ring on a neighbour of it"
        return f"{self.own.kind}, {FUSED}, gains made for the model{told}"

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


def qualify(
    required: str | Path | RequiredSpectrum,
    table: str | Path | TableParameters = "bergamo",
    *,
    model: str | Path | TableParameters | None = None,
    rules: str | None = None,
    scale: float = 1.0,
    set: Mapping[str, float] | None = None,  # noqa: A002 (the command's option has this name)
    settings: str = "default",
    record: str | Path | None = None,
    refit: Sequence[str] | None = None,
    runs: int | None = None,
    seed: int = 0,
    delay: int = 0,
    specimen: str = "",
    progress: Told = True,
) -> Qualification:
    """Make a motion that meets a required spectrum, run it until the test response spectrum passes, and judge it.

    Parameters
    ----------
    required : a name of config/required_spectra, a YAML file, or a spectrum. scale : of its levels [-].
    table : the simulated table. set : values to change in it, by dotted name or its last part.
    model : the identified table of the feedforward and the observer; the table as declared where not given.
    rules : a name of config/qualification_rules or a file; the spectrum's own where not given.
    record : accelerogram to start from, in place of random phases.
    refit : fit the model, with these effects, to each run that does not pass, instead of correcting the drive.
    runs : most runs. seed : of the phases and the sensors' noise. delay : samples by which a command acts late.
    specimen : what is tested, for the certificate.

    Raises
    ------
    ShakeError
        The motion does not fit the table, with the limit, the excess and what would fit; wrong files; a lost loop.
    """
    for name, value, most in (("seed", seed, LAST_SEED), ("delay", delay, MOST_DELAY)):
        if not 0 <= value <= most:
            raise ShakeError(f"{name} = {value} is not within 0 … {most}")
    chosen = load_settings(settings)
    if runs is not None:
        chosen = replace(chosen, running=chosen.running.replace(runs=runs))
    wanted, own = (
        (required, rules or "ieee_344") if isinstance(required, RequiredSpectrum) else load_required(str(required))
    )
    code, wanted = load_rules(rules or own), wanted.scaled(scale)
    declared = table if isinstance(table, TableParameters) else load_table(str(table))
    plant = declared.with_values({FULL_LAYOUT.full_name(k, "set"): float(v) for k, v in (set or {}).items()})
    carried = declared if model is None else model if isinstance(model, TableParameters) else load_table(str(model))
    step = chosen.loop.sample_time
    check_sampling(wanted, step)
    learn, _ = learning(carried, refit)
    test = Test(wanted, code, plant, chosen.motion_for(code), chosen.running, step)
    laboratory = _Laboratory(plant, chosen, delay, seed, None, [])
    band = SearchBand(chosen.search.low, chosen.search.high, plant.body.piston_area, plant.body.area_ratio)
    with Progress("qualify", progress) as bar:
        bar("making the motion", 0.0)
        motion = integrate(synthesise(wanted, plant, test.motion, step, seed, _record(record, step)), step)
        why = refusal(motion, plant, test.motion)
        if why:
            raise ShakeError(f"{wanted.name}: {why}")
        if chosen.loop.is_own:
            laboratory.own = own_loop(carried)
        bar(_described(motion, demand(motion, plant, test.motion)), 0.0)
        before = _search(laboratory, carried, "search_before", chosen.search, band, step)
        made, reason = _runs(test, laboratory, motion, carried, None if refit is None else learn, bar)
        after = _search(laboratory, carried, "search_after", chosen.search, band, step)
    when = datetime.now(timezone.utc).isoformat(timespec="seconds")
    about = {
        "specimen": specimen or f"simulated, {plant.value('body.specimen_mass'):g} kg",
        "table": "table" if isinstance(table, TableParameters) else str(table),
        "model": "as the table is declared"
        if model is None
        else "given"
        if isinstance(model, TableParameters)
        else str(model),
        "instruments": f"simulated sensors, accelerometer noise {plant.sensors.acceleration_noise:g} m/s² rms",
        "loop": f"{laboratory.words}, {1e-3 / step:g} kHz",
        "date": when,
        "seed": str(seed),
    }
    return Qualification(
        wanted,
        code,
        tuple(made),
        reason,
        step,
        about,
        tuple(laboratory.recordings),
        before,
        after,
        chosen.search.shift,
        test.motion.per_octave,
        band,
    )


def _described(states: Array, used: Demand) -> str:
    """Peaks of a motion and what it uses of the table, in words."""
    x, v, a = np.max(np.abs(states), axis=0)
    name, share = max(zip(used._fields, used, strict=True), key=lambda item: item[1])
    text = f"motion: {a:.2f} m/s², {v:.3f} m/s, {1e3 * x:.1f} mm at most"
    return f"{text}; {100.0 * share:.0f} % of the {name} that the table may use"


def _runs(
    test: Test,
    laboratory: _Laboratory,
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

    def told(number: int, run: Tested) -> None:
        ratio = run.judgement.ratio
        low, high = ratio.min(), ratio.max()
        text = f"run {number}: spectrum missed by {100.0 * run.error:.1f} %, TRS/RRS {low:.3f} to {high:.3f}"
        bar(f"{text}, {'passed' if run.judgement.passed else 'not passed'}", number / (test.running.runs + 1))

    return iterate_test(test, motion, play, model, None if learn is None else again, told)


def _record(path: str | Path | None, step: float) -> Array | None:
    """A record's acceleration at the loop's sample time."""
    if path is None:
        return None
    found = read_accelerogram(Path(path))
    time = np.arange(found.acceleration.size) * found.time_step
    return np.interp(np.arange(0.0, time[-1], step), time, found.acceleration)


def _search(
    laboratory: _Laboratory,
    model: TableParameters,
    name: str,
    wanted: SearchParameters,
    band: SearchBand,
    step: float,
) -> Resonance | None:
    """The resonance that a run of low random motion shows; None without a search or pressures."""
    if wanted.level == 0.0:
        return None
    count = round((wanted.duration + 2.0 * REST) / step)
    f = np.fft.rfftfreq(count, step)
    phases = np.random.RandomState(laboratory.seed).uniform(0.0, 2.0 * np.pi, f.size)
    inside = (f >= 0.8 * wanted.low) & (f <= 1.2 * wanted.high)
    noise = np.fft.irfft(np.where(inside, np.exp(1j * phases), 0.0), count)
    place = np.arange(count) * step
    noise *= wanted.level / np.std(noise) * smooth_step(np.minimum(place, place[::-1]) / REST)[0]
    drive = integrate(end_at_rest(filtered(noise, step, 0.8 * wanted.low, 0.0), step), step)
    return searched_in(laboratory.play(model, drive, name, 500 + len(laboratory.recordings)), band)
