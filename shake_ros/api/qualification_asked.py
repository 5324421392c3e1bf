"""What a qualification is asked for, with everything looked up; and its release on a live table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shake_ros.api.iterate import Learn, learning
from shake_ros.api.live_table import LiveTable, NotReleasedError, Release
from shake_ros.api.own_loop import OwnLoop
from shake_ros.api.qualification_files import QualificationSettings, load_required, load_rules, load_settings
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.qualification.motion import check_sampling
from shake_ros.core.qualification.required import RequiredSpectrum
from shake_ros.core.qualification.resonance import SearchBand
from shake_ros.core.qualification.run import Test
from shake_ros.core.quantities import ShakeError
from shake_ros.settings import load_table


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


def makes_loop(asked: Asked, live: LiveTable | None, model: object, refit: Sequence[str] | None) -> bool:
    """Whether gains are made for the model; a live table keeps its own where none is given."""
    return asked.settings.loop.is_own and (live is None or model is not None or refit is not None)


def asked_live(asked: Asked, live: LiveTable, set: Mapping[str, float] | None) -> Asked:  # noqa: A002 (as of `qualify`)
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
    carried = {} if own else {"model": "none was handed over; the loop as the laboratory runs it"}
    return replace(asked, about={**asked.about, **carried, "released by": by})
