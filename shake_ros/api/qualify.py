"""`qualify`: from a required response spectrum to the certificate, on a simulated table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.iterate import Learn, learning
from shake_ros.api.own_loop import own_loop
from shake_ros.api.progress import Progress, Told
from shake_ros.api.qualification import Qualification, searched_in
from shake_ros.api.qualification_files import (
    QualificationSettings,
    load_required,
    load_rules,
    load_settings,
)
from shake_ros.api.qualification_laboratory import Laboratory, SimulatedLaboratory
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.drive import integrate
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.qualification.motion import Demand, check_sampling, demand, refusal, synthesise
from shake_ros.core.qualification.required import RequiredSpectrum
from shake_ros.core.qualification.resonance import ResonanceSearch, SearchBand
from shake_ros.core.qualification.run import Test, Tested, iterate_test
from shake_ros.core.qualification.search_motion import search_motion
from shake_ros.core.quantities import ShakeError
from shake_ros.data.accelerograms import read_accelerogram
from shake_ros.settings import load_table

Array = NDArray[np.float64]
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
    asked = asked_of(
        required, table, model=model, rules=rules, scale=scale, set=set, settings=settings, refit=refit, runs=runs
    )
    about = {**asked.about, "specimen": specimen or asked.about["specimen"], "seed": str(seed)}
    laboratory = SimulatedLaboratory(asked.test.table, asked.settings, delay, seed, None, [])
    with Progress("qualify", progress) as bar:
        bar("making the motion", 0.0)
        motion = made_motion(asked.test, seed, record)
        if asked.settings.loop.is_own:
            laboratory.own = own_loop(asked.model)
        bar(described(motion, demand(motion, asked.test.table, asked.test.motion)), 0.0)
        return conduct(replace(asked, about=about), laboratory, motion, seed, bar)


@dataclass(frozen=True)
class Asked:
    """What a qualification is asked for, with everything looked up.

    Attributes
    ----------
    test : spectrum, rules, table, settings. model : of the feedforward. learn : the fit between runs; None corrects
    the drive. about : table, model, instruments, for the certificate.
    """

    test: Test
    settings: QualificationSettings
    model: TableParameters
    learn: Learn | None
    about: dict[str, str]

    @property
    def band(self) -> SearchBand:
        """Where resonances are sought."""
        body, search = self.test.table.body, self.settings.search
        return SearchBand(search.low, search.high, body.piston_area, body.area_ratio)


def asked_of(
    required: str | Path | RequiredSpectrum,
    table: str | Path | TableParameters,
    *,
    model: str | Path | TableParameters | None,
    rules: str | None,
    scale: float,
    set: Mapping[str, float] | None,  # noqa: A002 (as of `qualify`)
    settings: str,
    refit: Sequence[str] | None,
    runs: int | None,
) -> Asked:
    """The files that the arguments of `qualify` name."""
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
    about = {
        "specimen": f"simulated, {plant.value('body.specimen_mass'):g} kg",
        "table": _named(table, "table"),
        "model": "as the table is declared" if model is None else _named(model, "given"),
        "instruments": f"simulated sensors, accelerometer noise {plant.sensors.acceleration_noise:g} m/s² rms",
        "search": chosen.search.words,
    }
    test = Test(wanted, code, plant, chosen.motion_for(code), chosen.running, step)
    return Asked(test, chosen, carried, None if refit is None else learn, about)


def _named(table: str | Path | TableParameters, otherwise: str) -> str:
    return otherwise if isinstance(table, TableParameters) else str(table)


def made_motion(test: Test, seed: int, record: str | Path | None = None) -> Array:
    """The first drive of a test, (n, 3); ShakeError where it does not fit the table."""
    start = _record(record, test.sample_time)
    acceleration = synthesise(test.required, test.table, test.motion, test.sample_time, seed, start)
    motion = integrate(acceleration, test.sample_time)
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
    about = {**asked.about, "loop": f"{laboratory.words}, {1e-3 / step:g} kHz", "date": when}
    return Qualification(
        test.required,
        test.rules,
        tuple(made),
        reason,
        step,
        about,
        tuple(laboratory.recordings),
        before,
        after,
        asked.settings.search.shift,
        test.motion.per_octave,
        asked.band,
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
