"""`tune` of a table: observer and controller designed for it and held against its neighbours, as configurations.

`close_loop` shows with it how a controller would track better with the found table: the loop before and after.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.loops import load_controller, load_observer
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.control.laws.runner import Controller
from shake_ros.control.linear_loop import LAWS, Margins
from shake_ros.control.observer.model import ModelObserver
from shake_ros.control.observer.runner import Observer
from shake_ros.control.robust import Load, RobustSettings, Search, Uncertainty, neighbours, uncertainty_of
from shake_ros.control.trials import TrackingBenefit, Trials, TriedLaw, benefit, horizon, try_laws
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import Parameters, ShakeError, choice, quantity, strict_keys, unknown_name
from shake_ros.recordings.reference_file import build_program
from shake_ros.repair.close_loop import LoopClosure
from shake_ros.report.page import Page
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.report.text import sentence
from shake_ros.result_folder import refuse_existing, write_json, writing
from shake_ros.settings import find, load_content, load_parameters, load_table, save_table


def text_of(kind: str, parameters: Parameters, comment: Sequence[str]) -> str:
    """The YAML of a controller or an observer with units and meanings."""
    lines = [f"# {line}" for line in comment] + [f"kind: {kind}"]
    for f in dataclasses.fields(parameters):
        value, unit = getattr(parameters, f.name), f.metadata.get("unit", "")
        if isinstance(value, str):
            if value:
                lines.append(f"{f.name}: {value}")
            continue
        if isinstance(value, bool):
            value = str(value).lower()
        note = f"{unit}, {f.metadata['meaning']}" if unit not in ("", "-") else str(f.metadata["meaning"])
        lines.append(f"{f'{f.name}: {value} ':36s}# {note}")
    return "\n".join(lines) + "\n"


KEYS = ("reference", "seconds", "loads", "numbers")
FILES = ("controller.yaml", "observer.yaml", "tune.json")
UNCERTAINTY = "uncertainty.json"  # beside a table.yaml
SATURATED = 0.002  # share of the time at the limit from which it is reported
FULL = 0.97  # command, and share of the stroke, that a smaller reference should reach at most
SCALES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)


@dataclass(frozen=True, repr=False)
class TunedTable:
    """A table with the observer and the controller for it.

    Attributes
    ----------
    table : what is controlled and carried.
    laws : all that were tried, best first; the first is the one recommended.
    observer : its parameters.
    margins : of the recommended law on the linear model where it is least robust.
    findings : what oscillates, saturates or touches a stop, each with the number that would cure it.
    sound : whether the recommended law oscillates on no table.
    settings : of the tuning.
    """

    table: TableParameters
    laws: tuple[TriedLaw, ...]
    observer: ModelObserver
    margins: Margins
    findings: tuple[str, ...]
    settings: Mapping[str, Any]

    @property
    def best(self) -> TriedLaw:
        """The recommended law."""
        return self.laws[0]

    @property
    def sound(self) -> bool:
        """Whether it oscillates on no table, and its linear closed loops are stable."""
        return math.isfinite(self.best.score) and self.margins.stable

    @property
    def frame(self) -> ResultTable:
        """The laws side by side: errors on the table itself and the worst of its neighbours."""
        rows = [
            (
                law.kind,
                law.design.bandwidth,
                *(float(e) for e in law.trials[0].errors),
                *(float(e) for e in law.worst),
                law.rings,
            )
            for law in self.laws
        ]
        names = ("position", "velocity", "acceleration")
        worst = tuple(f"worst {name}" for name in names)
        formats = dict.fromkeys((*names, *worst), percent)
        return ResultTable(("law", "bandwidth [rad/s]", *names, *worst, "ringing / allowed"), rows, formats)

    def loop(self, sample_time: float | None = None) -> tuple[Observer, Controller]:
        """Observer and controller, ready for `sr.simulate`."""
        dt = float(self.settings["numbers"]["sample_time"]) if sample_time is None else sample_time
        law = self.best
        return (
            Observer("model", self.observer, dt, self.table),
            Controller(law.kind, law.parameters, dt, self.table),
        )

    def write(self, folder: str | Path, force: bool = False) -> Path:
        """Write controller.yaml, observer.yaml and tune.json beside the folder's table.yaml, which is made if missing.

        Raises
        ------
        ShakeError
            The files exist, or the closed loop oscillates somewhere; `force` writes anyway.
        """
        out = Path(folder)
        refuse_existing(*(out / name for name in FILES), force=force)
        if not self.sound and not force:
            raise ShakeError(f"{out}: not written: {'; '.join(self.findings)} (--force writes it anyway)")
        with writing():
            out.mkdir(parents=True, exist_ok=True)
            if not (out / "table.yaml").exists():
                save_table(out / "table.yaml", self.table, "The table of controller.yaml and observer.yaml.")
            notes = ["For table.yaml in this folder, by tune --table.", *self.lines[1:]]
            law = self.best
            (out / "controller.yaml").write_text(text_of(law.kind, law.parameters, notes), encoding="utf-8")
            (out / "observer.yaml").write_text(text_of("model", self.observer, notes), encoding="utf-8")
            write_json(out / "tune.json", self.content())
        return out

    def content(self) -> dict[str, Any]:
        """All figures, for JSON."""
        laws = [
            {
                "law": law.kind,
                "bandwidth": law.design.bandwidth,
                "added_damping": law.design.damping,
                "observer_jerk": law.design.observer.jerk_noise,
                "slowed": law.slowed,
                "ringing_over_allowed": law.rings,
                "tables": [
                    {
                        "errors": t.errors,
                        "ringing": t.ringing,
                        "at_rest": t.still,
                        "at_limit": t.at_limit,
                        "stroke": t.largest,
                        "jump": t.jump,
                    }
                    for t in law.trials
                ],
            }
            for law in self.laws
        ]
        margins = {name: value for name, value in dataclasses.asdict(self.margins).items() if name != "stable"}
        return {
            "schema": "shake_ros.tune/1",
            "recommended": self.best.kind,
            "sound": self.sound,
            "margins": margins,
            "findings": list(self.findings),
            "laws": laws,
        }

    @property
    def lines(self) -> list[str]:
        """What is recommended, how robust it is, and what was found."""
        return [
            f"recommended: {self.best.kind}",
            f"margins where least robust: {self.margins.text}",
            *self.findings,
        ]

    def describe(self, page: Page) -> None:
        """The laws side by side, and what is recommended."""
        page.result(self.frame, best=0)
        for line in self.lines:
            page.paragraph(sentence(line))

    def __repr__(self) -> str:
        return "\n".join([f"{self.frame!r}", *self.lines])


def tune_table(
    table: str | Path | TableParameters,
    settings: str | Path = "default",
    *,
    uncertainty: Uncertainty | None = None,
    laws: Sequence[str] = tuple(LAWS),
    progress: ProgressOption = True,
) -> TunedTable:
    """Design observer and controller for a table.

    Parameters
    ----------
    table : a table, a name of config/table, or a YAML file; uncertainty.json beside that is read.
    settings : config/robust_tuning/NAME.yaml or a file.
    uncertainty : of fitted parameters, where they are known otherwise.
    laws : of `LAWS`, those that are tried.

    Raises
    ------
    ShakeError
        Unknown names; a table whose oil column does not oscillate; no law that can be made for it.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.tune(sr.model().table, laws=["pid"])  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    shake_ros.quantities.UnknownName: unknown law 'pid'; known: ...
    """
    for law in laws:
        if law not in LAWS:
            raise unknown_name("law", law, LAWS)
    content, s = load_robust(str(settings))
    if isinstance(table, str | Path):
        beside = find("table", str(table)).with_name(UNCERTAINTY)
        uncertainty = uncertainty or (read_uncertainty(beside) if beside.is_file() else None)
    table = load_table(table)
    if table.layout is not FULL_LAYOUT:
        raise ShakeError(f"tune needs a table with a valve and hydraulics, not one of the model {table.layout.name}")
    with Progress("tune", progress) as bar:
        bar("neighbours of the table", 0.0)
        known = uncertainty or uncertainty_of(table, s)
        search = Search(neighbours(table, known, content["loads"], s), s)
        reference = build_program(content["reference"], s.sample_time).samples(
            0, round(content["seconds"] / s.sample_time)
        )
        fields = {
            "limit": 1.0,
            "start_time": 0.2,
            "model": "table.yaml",
            "model_bandwidth": s.model_bandwidth,
            "model_horizon": horizon(table, reference, s),
            "model_rate": s.model_rate,
            "loop_delay": s.loop_delay,
            "predict": True,
        }
        trials = Trials(search, reference, fields)
        found = try_laws(trials, laws, bar)
        if not found:
            raise ShakeError(f"tune: none of {', '.join(laws)} can be made for this table; try feedforward_pi")
        best = found[0]
        margins = search.margins(best.design)
        notes = findings(trials, best, reference, margins)
        observer = trials.observer_parameters(best.design.observer)
        return TunedTable(table, tuple(found), observer, margins, notes, content)


def load_robust(name: str) -> tuple[dict[str, Any], RobustSettings]:
    """The content of config/robust_tuning/<name>.yaml, or of a YAML file given by path, and its numbers."""
    content, path = load_content("robust_tuning", name, KEYS)
    content["loads"] = [load_of(given, f"{path}: loads") for given in content["loads"]]
    return content, RobustSettings.from_mapping(content["numbers"], f"{path}: numbers")


def load_of(given: Any, where: str) -> Load:
    """A load from its line of the file."""
    fields = dict(strict_keys(given, Load._fields, where, ("mass",), kind="key")) if isinstance(given, Mapping) else {}
    try:
        load = Load(**{name: float(value) for name, value in fields.items()})
    except (TypeError, ValueError):
        raise ShakeError(f"{where}: {given!r}: needs {{mass: kg}}, frequency and damping if it sways") from None
    if not (all(math.isfinite(value) for value in load) and min(load) >= 0.0):
        raise ShakeError(f"{where}: {given!r}: a number that is negative or not finite")
    return load


def findings(trials: Trials, law: TriedLaw, reference: NDArray[np.float64], margins: Margins) -> tuple[str, ...]:
    """What oscillates, saturates or touches a stop, and the number that would cure it."""
    found = []
    if not margins.stable or margins.sensitivity > 1.05 * trials.s.sensitivity:
        found.append(
            f"the margins are too small even at {law.design.bandwidth:.1f} rad/s: a sensitivity of "
            f"{margins.sensitivity:.2f}, wanted {trials.s.sensitivity:.2f}; better recordings of the table, or fewer "
            "loads and less additional delay in config/robust_tuning, would improve them"
        )
    if law.rings > 1.0:
        worst = int(np.argmax(trials.rings(law.trials)))
        further = worst % (trials.s.further_delay + 1)
        found.append(
            f"oscillates on neighbour {worst} ({further} more samples of delay): its acceleration beyond 15 Hz is "
            f"{law.trials[worst].ringing:.2f} of the reference's, at rest {law.trials[worst].still:.2f}, "
            f"{law.rings:.1f} times what is allowed, even at "
            f"{law.design.bandwidth:.1f} rad/s; the additional delay or the table's uncertainty has to shrink"
        )
    own = law.trials[0]
    if own.jump > trials.s.jump:
        found.append(
            f"the command jumps by {own.jump:.2f} in a sample; an interlock holds the table above {trials.s.jump:g} on "
            "(command_jump); a smaller model_rate in config/robust_tuning, or a less noisy sensor, reduces it"
        )
    if own.at_limit > SATURATED or own.largest > FULL:
        what = "the valve saturates" if own.at_limit > SATURATED else "the table reaches its end stop"
        scale = next((k for k in SCALES if _fits(trials, k * reference)), None)
        cure = f"{scale:g} times the motion fits" if scale else "not even 0.2 times this motion fits"
        found.append(f"{what} ({100.0 * own.at_limit:.1f} % of the time at the limit): {cure}")
    return tuple(found)


def _fits(trials: Trials, reference: NDArray[np.float64]) -> bool:
    commands, motion = trials.feedforward(np.ascontiguousarray(reference))
    return bool(
        np.max(np.abs(commands)) < FULL and np.max(np.abs(motion[:, 0])) < 0.5 * FULL * trials.table.body.stroke
    )


def read_uncertainty(path: Path) -> Uncertainty:
    """Names and covariance of a file that close_loop wrote beside its table."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        names, matrix = tuple(content["names"]), np.array(content["covariance"], dtype=np.float64)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ShakeError(f"{path}: no names and covariance ({error})") from None
    if matrix.shape != (len(names), len(names)) or not np.isfinite(matrix).all():
        raise ShakeError(f"{path}: covariance of shape {matrix.shape} for {len(names)} names")
    for name in names:
        if name not in FULL_LAYOUT.fields:
            raise unknown_name("parameter", name, FULL_LAYOUT.fields, str(path))
    return Uncertainty(names, matrix)


@dataclass(frozen=True)
class TrackingSettings(Parameters):
    """Content of config/identification/tracking.yaml."""

    observer: str = choice("observer, a name of config/observer")
    controller: str = choice("controller, a name of config/controller")
    reference: str = choice("reference, a name of config/reference")
    sample_time: float = quantity("s", "sample time of the loop", low=1e-5, high=0.1)
    delay: int = quantity("-", "samples by which a command reaches the valve late", low=0, high=100)


def tracking(
    result: LoopClosure, known: Uncertainty | None = None, tuned: TunedTable | None = None
) -> TrackingBenefit | None:
    """The identified table under the declared model and under the final one; None where nothing was added.

    None also for declared models that have no valve to control.

    Parameters
    ----------
    known : of the final table's parameters; the loop is looked at on neighbours within it as well.
    tuned : observer and gains made for the final table, which run beside.
    """
    table, declared = result.final.table, result.baseline.table
    if result.model.layout is not FULL_LAYOUT or not (result.search.steps or tuned):
        return None
    settings = load_parameters("identification", "tracking", TrackingSettings)

    def loops(model: TableParameters) -> tuple[Observer, Controller]:
        observer = load_observer(settings.observer, settings.sample_time, model)
        return observer, load_controller(settings.controller, settings.sample_time, model)

    program = build_program(settings.reference, settings.sample_time)
    content, s = load_robust("default")
    around = neighbours(table, known or uncertainty_of(table, s), content["loads"], s)
    return benefit(
        table,
        declared,
        table,
        loops,
        program.samples(0, program.length),
        settings.reference,
        delay=settings.delay,
        tuned=(tuned.loop(settings.sample_time), tuned.margins) if tuned else None,
        neighbours=around,
    )
