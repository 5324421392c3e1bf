"""`commission`: bring a new table into service: gentle motion, model, gains, higher level, each step released."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from shake_ros.api.close_loop import Discovery, close_loop
from shake_ros.api.identify import identify
from shake_ros.api.live_table import LiveTable
from shake_ros.api.model import Model
from shake_ros.api.model import model as model_of
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Recordings
from shake_ros.api.simulate import Simulation
from shake_ros.api.tune_table import TunedTable, tune_table
from shake_ros.commissioning.steps import (
    LEVEL,
    UNITS,
    Array,
    CommissionSettings,
    CommissionStage,
    LiveStage,
    SimulatedStage,
    Step,
    announced,
    interlock_of,
    load_commission,
    tracked,
)
from shake_ros.control.metrics import come_to_rest
from shake_ros.control.robust import Uncertainty
from shake_ros.experiment_design.next_recording import next_recording
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.uncertainty import known_covariance
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.recordings.bags import TableRecording
from shake_ros.recordings.reference_file import build_program
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.safety.causes import InterlockParameters
from shake_ros.settings import load_table, save_table

EVIDENCE = "for the evidence"
SHOWING = "to show what the model lacks"


@dataclass(frozen=True, repr=False)
class Commission(Result):
    """The result. steps : that were run. reason : why it ended before the last one, empty where it did not."""

    numbers, page_name = "commission.json", "commission"
    steps: tuple[Step, ...]
    settings: CommissionSettings
    reason: str

    @property
    def complete(self) -> bool:
        """Whether every step was released, run and sound."""
        return not self.reason

    @property
    def tuned(self) -> TunedTable | None:
        """The last observer and gains that are sound, with their table."""
        return next((s.tuned for s in reversed(self.steps) if s.tuned is not None and s.tuned.sound), None)

    @property
    def frame(self) -> ResultTable:
        """The steps: level, loop, errors, what the model explains."""
        rows = [
            (f"{step.level:g}", step.loop, *(step.error or (np.nan,) * 3), step.explained, step.held or "no hold")
            for step in self.steps
        ]
        names = ("position", "velocity", "acceleration", "model's error")
        return ResultTable(("level", "loop", *names, "interlock"), rows, dict.fromkeys(names, percent))

    @property
    def page(self) -> Page:
        """The steps, what each taught, and the curves of each run."""
        verdict, lines = self.summary()
        page = Page("Commissioning", verdict)
        page.heading("Steps")
        page.result(self.frame, warn=[i for i, step in enumerate(self.steps) if step.held])
        page.paragraph(
            "Errors are rms errors of the true motion if it is known, otherwise of the measured one, over the rms of "
            "the reference about its mean.",
            note=True,
        )
        page.heading("Table and gains")
        for line in lines:
            page.paragraph(line)
        for i, step in enumerate(self.steps):
            title = f"Step {i + 1}, level {step.level:g}{', ' if step.purpose else ''}{step.purpose}"
            page.heading(title, detail=True)
            limits = [(name, f"{value:.4g} {UNITS[name]}") for name, value in step.limits.items()]
            page.table(("limit of the interlock", "holds beyond"), limits)
            for line in step.findings:
                page.paragraph(line)
            page.chart(run_chart(f"step_{i + 1}", title, step))
        return page

    def files(self, work: Path, _: Path, /) -> None:
        """Write table.yaml, controller.yaml, observer.yaml, interlock.yaml and the recordings."""
        if self.tuned is not None:
            save_table(work / "table.yaml", self.tuned.table, "Found by commission.")
            self.tuned.write(work)
        text = yaml.safe_dump(dict(self.steps[-1].interlock), sort_keys=False) if self.steps else ""
        head = f"# Limits of level {self.steps[-1].level:g}, by commission.\n" if self.steps else ""
        (work / "interlock.yaml").write_text(head + text, encoding="utf-8")
        for step in self.steps:
            Simulation(step.run).write(work / "recordings" / step.run.name)

    def summary(self) -> tuple[str, list[str]]:
        """The verdict, and lines on table and gains."""
        last = self.steps[-1] if self.steps else None
        verdict = "Complete: every step was released, run and sound." if self.complete else f"Ended: {self.reason}."
        if self.tuned is None:
            return verdict, ["No sound gains were found."]
        lines = [
            "table.yaml is the fitted table, controller.yaml and observer.yaml are made for it; the nodes take them "
            "by path.",
            f"{self.tuned.best.kind}, {self.tuned.best.design.bandwidth:.1f} rad/s; margins on the linear model where "
            f"least robust: {self.tuned.margins.text}.",
            *self.tuned.findings,
        ]
        return verdict, lines + ([f"interlock.yaml has the limits of level {last.level:g}."] if last else [])

    def content(self) -> dict[str, Any]:
        """All figures, for JSON."""
        steps = [
            {
                "level": step.level,
                "loop": step.loop,
                "purpose": step.purpose,
                "limits": dict(step.limits),
                "error": list(step.error) if step.error else None,
                "held": step.held,
                "model_error": step.explained,
                "effects": list(step.added),
                "gains": step.tuned.content() if step.tuned else None,
            }
            for step in self.steps
        ]
        return {"schema": "shake_ros.commission/1", "complete": self.complete, "reason": self.reason, "steps": steps}


class _Plan(NamedTuple):
    """A run to come: its level, the reference (n, 3), and what it is for where it is not a level's first run."""

    level: float
    motion: Array
    purpose: str = ""


@dataclass
class _Way:
    """What moves the table, the motion, and what is known of the table so far."""

    stage: CommissionStage
    declared: Model
    settings: CommissionSettings
    progress: ProgressOption
    runs: list[TableRecording] = field(default_factory=list)
    found: Discovery | None = None

    def motion(self, level: float) -> Array:
        """The reference at a level, faded to rest, (n, 3)."""
        dt = self.settings.numbers.sample_time
        rows = build_program(self.settings.reference, dt).samples(0, round(self.settings.seconds / dt))
        return level * come_to_rest(rows, dt)

    def play(self, plan: _Plan, tuned: TunedTable | None, interlock: Mapping[str, Any]) -> Step:
        """Run a motion under a loop; what lies behind a hold of the interlock does not count."""
        level = plan.level
        name = f"step_{len(self.runs) + 1}_level_{level:g}"
        kind = self.settings.controller if tuned is None else tuned.best.kind
        made = self.stage.run(plan.motion, tuned, interlock, name, len(self.runs) + 1)
        self.runs.append(made.recording)
        limits = {cause: float(interlock["causes"][cause]["threshold"]) for cause in self.stage.limited}
        error = None if made.held else tracked(made.recording)
        return Step(level, kind, limits, interlock, made.recording, error, made.held, purpose=plan.purpose)

    def learn(self, level: float) -> tuple[float, TunedTable, tuple[str, ...]]:
        """Model and gains by all runs so far: the model's error on the newest one, the gains, the effects added."""
        fitted = identify(self.declared, Recordings(self.runs), progress=self.progress)
        table, error = fitted.table, float(fitted.error["acceleration"][-1])  # of the newest run
        blocks = RecordingProblem(list(fitted.estimation)).blocks()
        known, added = Uncertainty(*known_covariance(fitted.fit.fit, blocks)), tuple[str, ...]()
        if level >= self.settings.search_from and len(self.runs) > 1:
            found = self.found = self._searched()
            added = tuple(effect.name for effect in found.effects)
            if added:
                table, known = found.table, found.uncertainty
                error = float(list(found.closed.final.estimation.values())[-1]["acceleration"])
        s = self.settings
        tuned = tune_table(table, s.tuning, uncertainty=known, laws=s.laws, progress=self.progress)
        return error, tuned, added

    def _searched(self) -> Discovery:
        """What the model lacks by all runs; a search that was made goes on with the newest one."""
        if self.found is not None:
            return self.found.extended(self.runs[-1], progress=self.progress)
        return close_loop(self.declared, [*self.runs[:-2], self.runs[-1]], self.runs[-2], progress=self.progress)

    def deciding(self, level: float, interlock: Mapping[str, Any]) -> _Plan | None:
        """The motion within the interlock of a level that distinguishes what the search left open; None for none."""
        if self.found is None or not self.found.open:
            return None
        limits = InterlockParameters.from_mapping(interlock, LEVEL)
        asked = next_recording(self.found, interlock=limits, progress=self.progress)
        if asked.motion is None:
            return None
        motion = asked.motion_at(self.settings.numbers.sample_time)
        return _Plan(
            level, motion, f"to distinguish {', '.join(asked.distinguished)}" if asked.distinguished else SHOWING
        )


def run_chart(name: str, title: str, step: Step) -> Chart:
    """Reference and sensors of a run over time, and the command."""
    run = step.run
    assert run.reference is not None and run.valve_command is not None and run.acceleration is not None
    wanted = ChartSeries("reference", 1e3 * run.reference[:, 0], "c5", kind="dashed")
    felt = ChartSeries("reference", run.reference[:, 2], "c5", kind="dashed")
    command = ChartSeries("valve command", run.valve_command, "c1")
    rows = (
        Panel("position [mm]", run.time, (wanted, ChartSeries("measured", 1e3 * run.position, "c0"))),
        Panel("acceleration [m/s²]", run.time, (ChartSeries("measured", run.acceleration, "c0"), felt)),
        Panel("command [-]", run.time, (command,), height=120),
    )
    return Chart(name, "time [s]", rows, f"{title}: reference, sensors and command")


def commission(
    table: str | Path | TableParameters = "bergamo",
    *,
    set: Mapping[str, float] | None = None,  # noqa: A002 (the command's option has this name)
    model: Model | None = None,
    settings: str = "default",
    delay: int = 1,
    live: LiveTable | None = None,
    release: Callable[[str], bool] = lambda _: True,
    progress: ProgressOption = True,
) -> Commission:
    """Bring a table into service: run, fit, make gains, go higher; each run is released first.

    Parameters
    ----------
    table : the table as it is declared: a name of config/table, a YAML file, or a table.
    set : values in which the simulated table differs from that, by dotted name or its last part.
    model : what is fitted; the declared table's full model where not given.
    settings : config/commission/NAME.yaml or a file.
    delay : samples by which a command reaches the simulated valve late.
    live : the table of a running graph in the simulated one's place, as `shake_ros.ros.live_table.live_table` gives it.
    release : is called with a description of the next run, and returns whether it may begin.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError
        Unknown names; a closed loop that diverges; an interlock that does not let commands act.

    Examples
    --------
    >>> import shake_ros as sr
    >>> refused = sr.commission("bergamo", release=lambda text: False, progress=False)
    >>> refused.complete, refused.reason
    (False, 'level 0.1 was not released')
    """
    s = load_commission(settings)
    declared = load_table(table)
    if declared.layout is not FULL_LAYOUT:
        raise ShakeError(f"commission needs a table with a valve and hydraulics, not one of {declared.layout.name}")
    changes = FULL_LAYOUT.changes(set)
    known = model or model_of("full", declared)
    if live is None:
        stage: CommissionStage = SimulatedStage(declared.with_values(changes), s, delay)
    else:
        stage = LiveStage.on(live, s, changes)
    with Progress("commission", progress) as bar:
        steps, reason = _climb(_Way(stage, known, s, bar), release)
    return Commission(tuple(steps), s, reason)


def _climb(way: _Way, release: Callable[[str], bool]) -> tuple[list[Step], str]:
    """The steps up to the first one that is not released, held or not sound; why, empty where none.

    Where the search leaves rivals open at the last level, the motion that distinguishes them is a step of its own; one
    that is not released is left out.
    """
    s, steps = way.settings, list[Step]()
    tuned, named = None, f"{s.controller}, {s.observer}"
    waiting = [_Plan(level, way.motion(level)) for level in s.levels]
    evidence = waiting[-1]._replace(purpose=EVIDENCE)
    while waiting:
        plan = waiting.pop(0)
        level = plan.level
        deciding = plan.purpose not in ("", EVIDENCE)
        interlock = way.stage.within(interlock_of(s, way.motion(level), s.levels[0] / level))
        announcement = announced(len(steps), plan.level, plan.motion, named, interlock, way.stage.limited, plan.purpose)
        if not release(f"{announcement}{way.stage.words}"):
            if not deciding:
                return steps, f"level {level:g} was not released"
            waiting = [evidence]
            continue
        step = way.play(plan, tuned, interlock)
        steps.append(step)
        if step.held:
            return steps, f"level {level:g}: the interlock held: {step.held}"
        if plan.purpose == EVIDENCE:
            break
        explained, tuned, added = way.learn(level)
        steps[-1] = replace(step, explained=explained, tuned=tuned, added=added)
        if not tuned.sound:
            return steps, f"after level {level:g} no gains are sound: {'; '.join(tuned.findings)}"
        named = f"{tuned.best.kind} of level {level:g}"
        if not waiting:
            asked = None if deciding else way.deciding(level, interlock)
            waiting = [evidence] if asked is None else [asked, evidence]
    return steps, ""
