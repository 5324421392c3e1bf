"""What a qualification is asked for, with everything looked up in config/; its files; its release on a live table."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import OWN, LiveTable, NotReleasedError, OwnLoop, Release
from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.quantities import Parameters, ShakeError, choice, member_from, quantity, strict_keys
from shake_ros.core.reference.baseline import states_from_rest
from shake_ros.iteration.iterate import Learn, learning
from shake_ros.qualification.assessment import Rules, SpectrumAssessment, assess, measured_motion
from shake_ros.qualification.motion import MotionParameters, aimed, check_sampling, corrected_drive, demand
from shake_ros.qualification.required import FORMULAS, POINTS, RequiredSpectrum, from_points
from shake_ros.qualification.resonance import SearchBand, SearchParameters
from shake_ros.settings import find, load_table, read_yaml

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunParameters(Parameters):
    """How a test is iterated, and when it is given up."""

    runs: int = quantity("-", "most runs", low=1, high=50)
    gain: float = quantity("-", "share of a spectrum's error that the next drive corrects", low=0.1, high=1.0)
    growth: float = quantity("-", "error over that of the previous run above which it grows", low=1.0, high=10.0)
    near_limit: float = quantity("-", "share of half the stroke above which the end stops are near", low=0.5, high=1.0)


@dataclass(frozen=True)
class Tested:
    """One run.

    Attributes
    ----------
    drive : (n, 3) [m], [m/s], [m/s²].
    motion : (n,) measured acceleration as it is assessed [m/s²].
    assessment : its verdicts.
    error : rms of ln(TRS/aim) over the matched frequencies [-].
    """

    drive: Array
    motion: Array
    assessment: SpectrumAssessment
    error: float


@dataclass(frozen=True)
class Test:
    """What is asked of whom: the spectrum, the rules, the table that it is to fit, the settings."""

    __test__ = False  # no test of pytest

    required: RequiredSpectrum
    rules: Rules
    table: TableParameters
    motion: MotionParameters
    running: RunParameters
    sample_time: float


def missed(
    motion: Array, sample_time: float, required: RequiredSpectrum, rules: Rules, per_octave: int
) -> tuple[Array, float]:
    """The TRS at the matched frequencies (m,) [m/s²], and rms of ln(TRS/aim) of those within the required band [-]."""
    f, levels = aimed(required, per_octave, rules.aim, rules.aim_last)
    found = np.abs(response_spectrum(motion, sample_time, f, required.damping, band_limited=True).acceleration)
    inside = f <= required.frequencies[-1] * (1.0 + 1e-9)
    return found, float(np.sqrt(np.mean(np.square(np.log(found / levels)[inside]))))


def failing(assessment: SpectrumAssessment) -> str:
    """The rules that do not hold, with what was asked and measured."""
    return "; ".join(f"{v.rule}, {v.asked}: {v.measured}" for v in assessment.verdicts if v.passed is False)


def given_up(test: Test, errors: list[float], position: float) -> str:
    """Why no further run is made; empty where one is."""
    p = test.running
    stop = 0.5 * test.table.value("body.stroke")
    if position >= p.near_limit * stop:
        return f"the table reached {1e3 * position:.0f} mm, the end stops are at {1e3 * stop:.0f} mm"
    if len(errors) >= 3 and errors[-1] > p.growth * errors[-2] and errors[-2] > p.growth * errors[-3]:
        listed = ", ".join(f"{100.0 * e:.1f}" for e in errors)
        return f"the spectrum's error grew twice ({listed} % rms of the logarithm)"
    if len(errors) < p.runs:
        return ""
    return f"not passed after {len(errors)} {'run' if len(errors) == 1 else 'runs'}"


def iterate_test(
    test: Test,
    first: Array,
    play: Callable[[TableParameters, Array, int], tuple[Array, Array]],
    model: TableParameters,
    learn: Callable[[TableParameters, int], TableParameters] | None = None,
    on_run: Callable[[int, Tested], None] = lambda _, __: None,
) -> tuple[list[Tested], str]:
    """Run after run.

    Parameters
    ----------
    first : (n, 3) the motion.
    play : plays a drive under a model in the run of this number and returns the measured acceleration (n,) [m/s²] and
        position (n,) [m].
    learn : the next model from this one and the recording of the run of this number; None corrects the drive.

    Returns
    -------
    (runs, reason) : at least one; `reason` is empty where the last one passed.
    """
    made, errors, drive, carried = list[Tested](), list[float](), first, model
    while True:
        acceleration, position = play(carried, drive, len(made))
        motion = measured_motion(acceleration, test.sample_time, test.rules)
        found, error = missed(motion, test.sample_time, test.required, test.rules, test.motion.per_octave)
        errors.append(error)
        made.append(Tested(drive, motion, assess(motion, test.sample_time, test.required, test.rules), errors[-1]))
        on_run(len(made), made[-1])
        if made[-1].assessment.passed:
            return made, ""
        reason = given_up(test, errors, float(np.max(np.abs(position))))
        if reason:
            return made, f"{reason}; what fails: {failing(made[-1].assessment)}"
        if learn is not None:
            carried = learn(carried, len(made) - 1)
            continue
        peak, gain = float(np.max(np.abs(motion))), test.running.gain
        following = corrected_drive(drive[:, 2], found, peak, test.required, test.motion, test.sample_time, gain)
        states = states_from_rest(following, test.sample_time)
        used = max(demand(states, test.table, test.motion))
        if used > 1.0:
            return made, f"the next drive would need {used:.2f} times what the table may use"
        drive = states


SPECTRA, RULES = "required_spectra", "qualification_rules"


@dataclass(frozen=True)
class QualificationLoop(Parameters):
    """The loop under which a test runs."""

    controller: str = choice("a name of config/controller, or own")
    observer: str = choice("a name of config/observer, or own")
    sample_time: float = quantity("s", "of the loop", low=1e-4, high=0.02)

    @property
    def is_own(self) -> bool:
        """Whether observer and controller are made for the model; ShakeError where one of them alone is."""
        if (self.controller == OWN) is not (self.observer == OWN):
            raise ShakeError(f"loop: controller {self.controller}, observer {self.observer}: own goes for both or none")
        return self.controller == OWN


@dataclass(frozen=True)
class QualificationSettings:
    """Content of config/qualification."""

    motion: Mapping[str, Any]
    running: RunParameters
    loop: QualificationLoop
    search: SearchParameters

    def motion_for(self, rules: Rules) -> MotionParameters:
        """How a motion is made for these rules."""
        return MotionParameters.from_mapping({**self.motion, "aim": rules.aim, "aim_last": rules.aim_last}, "motion")


def load_settings(name: str) -> QualificationSettings:
    """config/qualification/<name>.yaml, or a YAML file."""
    path = find("qualification", name)
    keys = ("motion", "running", "loop", "search")
    content = strict_keys(read_yaml(path), keys, str(path), keys, kind="key")
    return QualificationSettings(
        dict(content["motion"]),
        RunParameters.from_mapping(content["running"], f"{path}: running"),
        QualificationLoop.from_mapping(content["loop"], f"{path}: loop"),
        SearchParameters.from_mapping(content["search"], f"{path}: search"),
    )


def load_rules(name: str) -> Rules:
    """config/qualification_rules/<name>.yaml, or a YAML file."""
    path = find(RULES, name)
    return Rules.from_mapping(read_yaml(path), str(path))


def load_required(name: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum of config/required_spectra, or of a YAML file, and the name of its rules."""
    path = find(SPECTRA, name)
    return required_from(read_yaml(path), str(path))


def required_from(content: Any, where: str) -> tuple[RequiredSpectrum, str]:
    """A required spectrum from a mapping, and the name of its rules."""
    if not isinstance(content, Mapping) or "rules" not in content:
        raise ShakeError(f"{where}: missing key 'rules' (a name of config/{RULES} or a YAML file)")
    rest = {key: value for key, value in content.items() if key != "rules"}
    rules = str(content["rules"])
    if rest.get("kind") == "points":
        return from_points(strict_keys(rest, POINTS, where, POINTS, kind="key"), where), rules
    if rest.get("kind") not in FORMULAS:
        known = ", ".join(sorted((*FORMULAS, "points")))
        raise ShakeError(f"{where}: kind '{rest.get('kind')}' is not known; known: {known}")
    _, formula = member_from(rest, FORMULAS, where, kind="required spectrum")  # type: ignore[type-var]
    return formula.required(), rules


def required_json(required: RequiredSpectrum) -> dict[str, Any]:
    """A required spectrum as points, which `required_of` reads."""
    return {
        "name": required.name,
        "frequencies": required.frequencies.tolist(),
        "levels": required.levels.tolist(),
        "damping": required.damping,
        "zero_period": required.zero_period,
        "source": required.source,
    }


def assessment_json(assessment: SpectrumAssessment) -> dict[str, Any]:
    """Verdicts and spectra of a run."""
    return {
        "passed": assessment.passed,
        "rules": [
            {"rule": v.rule, "asked": v.asked, "measured": v.measured, "passed": v.passed} for v in assessment.verdicts
        ],
        "frequencies": assessment.frequencies.tolist(),
        "required": assessment.required.tolist(),
        "found": assessment.found.tolist(),
    }


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of each file below a folder, by its path from there."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@dataclass(frozen=True)
class Asked:
    """What a qualification is asked for, with everything looked up.

    Attributes
    ----------
    test : spectrum, rules, table, settings.
    model : of the feedforward.
    learn : the fit between runs; None corrects the drive.
    about : table, model, instruments, for the certificate.
    makes_loop : whether gains are made for the model; a live table keeps its own where none is given.
    """

    test: Test
    settings: QualificationSettings
    model: TableParameters
    learn: Learn | None
    about: dict[str, str]
    makes_loop: bool

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
    specimen: str,
    seed: int,
    live: LiveTable | None,
) -> Asked:
    """The files that the arguments of `qualify` name, and what the certificate says of the table."""
    chosen = load_settings(settings)
    if runs is not None:
        chosen = replace(chosen, running=chosen.running.replace(runs=runs))
    wanted, own = (
        (required, rules or "ieee_344") if isinstance(required, RequiredSpectrum) else load_required(str(required))
    )
    code, wanted = load_rules(rules or own), wanted.scaled(scale)
    declared = load_table(table)
    plant = declared.with_values(FULL_LAYOUT.changes(set))
    carried = declared if model is None else load_table(model)
    step = chosen.loop.sample_time
    check_sampling(wanted, step)
    learn, _ = learning(carried, refit)
    about = {
        "specimen": specimen or f"simulated, {plant.value('body.specimen_mass'):g} kg",
        "table": _named(table, "table"),
        "model": "as the table is declared" if model is None else _named(model, "given"),
        "instruments": f"simulated sensors, accelerometer noise {plant.sensors.acceleration_noise:g} m/s² rms",
        "search": chosen.search.words,
        "seed": str(seed),
    }
    test = Test(wanted, code, plant, chosen.motion_for(code), chosen.running, step)
    makes_loop = chosen.loop.is_own and (live is None or model is not None or refit is not None)
    asked = Asked(test, chosen, carried, None if refit is None else learn, about, makes_loop)
    return asked if live is None else _asked_live(asked, live, set)


def _named(table: str | Path | TableParameters, otherwise: str) -> str:
    return otherwise if isinstance(table, TableParameters) else str(table)


def _asked_live(asked: Asked, live: LiveTable, set: Mapping[str, float] | None) -> Asked:  # noqa: A002 (as above)
    """The same on a live table; ShakeError where it cannot be asked for there."""
    if set:
        raise ShakeError(f"set {', '.join(set)}: values of the simulated table; a live one has its own")
    if abs(live.sample_time - asked.test.sample_time) > 1e-9:
        wanted = f"the qualification's loop has one every {asked.test.sample_time:g} s"
        raise ShakeError(f"live: a sample every {live.sample_time:g} s, {wanted} (sample_time in config/qualification)")
    given = asked.about["specimen"]
    about = {
        **asked.about,
        "specimen": "on the live table" if given.startswith("simulated, ") else given,
        "table": f"{live.words}; declared as {asked.about['table']}",
        "instruments": "of the live table, as recorded",
    }
    return replace(asked, about=about)


def released(asked: Asked, live: LiveTable, own: OwnLoop | None, words: str, release: Release) -> Asked:
    """Who lets a test move the live table, noted for the certificate; NotReleasedError where nobody does."""
    loop = live.loop if own is None else f"{own.kind} made for the model, exchanged while the pressure is off"
    search = "" if asked.settings.search.level == 0.0 else f"{asked.settings.search.words} before and after; "
    by = release(f"{live.words}; loop: {loop}; {search}{words}; at most {asked.test.running.runs} runs")
    if not by:
        raise NotReleasedError("not released; nothing was moved")
    carried = {} if own else {"model": "none was handed over; observer and controller as the laboratory runs them"}
    return replace(asked, about={**asked.about, **carried, "released by": by})
