"""What a qualification is asked for, with everything looked up in config/; its files; its release on a live table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.live_table import OWN, LiveTable, NotReleasedError, OwnLoop, Release
from shake_ros.iteration.iterate import Learn, learning
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.qualification.assessment import Rules
from shake_ros.qualification.motion import MotionParameters, check_sampling
from shake_ros.qualification.required import RequiredSpectrum, load_required
from shake_ros.qualification.resonance import SearchBand, SearchParameters
from shake_ros.quantities import Parameters, ShakeError, choice, quantity
from shake_ros.settings import load_content, load_parameters, load_table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunParameters(Parameters):
    """How a test is iterated, and when it is given up."""

    runs: int = quantity("-", "most runs", low=1, high=50)
    gain: float = quantity("-", "share of a spectrum's error that the next drive corrects", low=0.1, high=1.0)
    growth: float = quantity("-", "error over that of the previous run above which it grows", low=1.0, high=10.0)
    near_limit: float = quantity("-", "share of half the stroke above which the end stops are near", low=0.5, high=1.0)


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
    content, path = load_content("qualification", name, ("motion", "running", "loop", "search"))
    return QualificationSettings(
        dict(content["motion"]),
        RunParameters.from_mapping(content["running"], f"{path}: running"),
        QualificationLoop.from_mapping(content["loop"], f"{path}: loop"),
        SearchParameters.from_mapping(content["search"], f"{path}: search"),
    )


def load_rules(name: str) -> Rules:
    """config/qualification_rules/<name>.yaml, or a YAML file."""
    return load_parameters("qualification_rules", name, Rules)


@dataclass(frozen=True)
class Asked:
    """What a qualification is asked for, with everything looked up."""

    # required, rules: the spectrum and the code
    required: RequiredSpectrum
    rules: Rules
    table: TableParameters  # that it is to fit
    settings: QualificationSettings
    model: TableParameters  # of the feedforward
    learn: Learn | None  # the fit between runs; None corrects the drive
    about: dict[str, str]  # table, model, instruments, for the certificate
    makes_loop: bool  # whether gains are made for the model; a live table keeps its own where none is given

    @property
    def motion(self) -> MotionParameters:
        """How a motion is made for these rules."""
        return self.settings.motion_for(self.rules)

    @property
    def sample_time(self) -> float:
        """Of the loop [s]."""
        return self.settings.loop.sample_time

    @property
    def band(self) -> SearchBand:
        """Where resonances are sought."""
        body, search = self.table.body, self.settings.search
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
    check_sampling(wanted, chosen.loop.sample_time)
    named = "table" if isinstance(table, TableParameters) else str(table)
    given = "given" if isinstance(model, TableParameters) else str(model)
    about = {
        "specimen": specimen or f"simulated, {plant.value('body.specimen_mass'):g} kg",
        "table": named,
        "model": "as the table is declared" if model is None else given,
        "instruments": f"simulated sensors, accelerometer noise {plant.sensors.acceleration_noise:g} m/s² rms",
        "search": chosen.search.words,
        "seed": str(seed),
    }
    if live is not None:
        _check_live(live, chosen.loop.sample_time, set)
        about |= {
            "specimen": specimen or "on the live table",
            "table": f"{live.words}; declared as {named}",
            "instruments": "of the live table, as recorded",
        }
    learn = learning(refit)
    makes_loop = chosen.loop.is_own and (live is None or model is not None or refit is not None)
    return Asked(wanted, code, plant, chosen, carried, learn, about, makes_loop)


def _check_live(live: LiveTable, sample_time: float, set: Mapping[str, float] | None) -> None:  # noqa: A002 (as above)
    """ShakeError where it cannot be asked for on a live table."""
    if set:
        raise ShakeError(f"set {', '.join(set)}: values of the simulated table; a live one has its own")
    if abs(live.sample_time - sample_time) > 1e-9:
        wanted = f"the qualification's loop has one every {sample_time:g} s"
        raise ShakeError(f"live: a sample every {live.sample_time:g} s, {wanted} (sample_time in config/qualification)")


def released(asked: Asked, live: LiveTable, own: OwnLoop | None, words: str, release: Release) -> Asked:
    """Who lets a test move the live table, noted for the certificate; NotReleasedError where nobody does."""
    loop = live.loop if own is None else f"{own.kind} made for the model, exchanged while the pressure is off"
    search = "" if asked.settings.search.level == 0.0 else f"{asked.settings.search.words} before and after; "
    by = release(f"{live.words}; loop: {loop}; {search}{words}; at most {asked.settings.running.runs} runs")
    if not by:
        raise NotReleasedError("not released; nothing was moved")
    carried = {} if own else {"model": "none was handed over; observer and controller as the laboratory runs them"}
    return replace(asked, about={**asked.about, **carried, "released by": by})
