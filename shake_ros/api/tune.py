"""`tune`: the gains of a controller that minimise (6.42) over loads and perturbed tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shake_ros.api.loops import MODELS, Combination, Course, Setup, load_setup, strict
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.tune_table import text_of, tune_table
from shake_ros.control import closed_loop
from shake_ros.control.closed_loop import ClosedLoop, Loop, run_batch
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.law import LawParameters
from shake_ros.control.laws.runner import Controller
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.result_folder import refuse_existing, writing
from shake_ros.settings import find, load_variant, read_yaml

KEYS = (
    "plant", "observer", "model", "references", "begin", "seconds", "loads", "perturbed", "seed", "robustness",
    "position_weight", "travel_price", "acceleration_price", "evaluations", "fixed",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class TunedController:
    """A controller with the gains that were found.

    Attributes
    ----------
    kind, parameters : the law with the new gains.
    start, gains : first and new values by name.
    before, after : cost [-].
    settings : of the tuning.
    """

    kind: str
    parameters: LawParameters
    start: Mapping[str, float]
    gains: Mapping[str, float]
    before: float
    after: float
    settings: Mapping[str, Any]

    def write(self, out: str | Path, origin: str = "shake_ros.tune", force: bool = False) -> None:
        """Write the configuration, .yaml, with what it came from in a comment."""
        path, s = Path(out), self.settings
        check_target(path, force)
        comment = [
            origin,
            f"cost {self.before:.4f} before, {self.after:.4f} after: mean over {len(s['loads'])} loads and "
            f"{len(s['references'])} references, worst of {s['perturbed']} perturbed tables",
        ]
        with writing():
            path.write_text(text_of(self.kind, self.parameters, comment), encoding="utf-8")

    def __repr__(self) -> str:
        changes = [f"  {name:24s} {self.start[name]:12.4g} → {value:.4g}" for name, value in self.gains.items()]
        return "\n".join([f"cost {self.before:.4f} → {self.after:.4f}", *changes])


def tune(
    controller: str | Path | TableParameters,
    settings: str | Path = "default",
    *,
    progress: ProgressOption = True,
    **changes: Any,
) -> Any:
    """Tune a controller's gains by Nelder and Mead on closed loops with the tables of a comparison.

    Of a table instead, `sr.tune(table)`, it designs observer and controller for it: see `tune_table.tune_table`, whose
    arguments it then takes.

    Parameters
    ----------
    controller : config/controller/NAME.yaml or a file: law and first gains; or a table.
    settings : config/tune/NAME.yaml or a file.
    progress : whether to show it, or a function to call with it.
    changes : keys of the settings with other values, such as `loads` [kg], `references`, `observer`, `model` ("none",
        "load", "fixed"), `perturbed`, `evaluations`; None leaves a key as it is.

    Raises
    ------
    ShakeError
        Unknown names, a controller without gains, settings out of range.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.tune("pid", evaluations=0)
    Traceback (most recent call last):
        ...
    shake_ros.quantities.ShakeError: evaluations = 0: must be at least 1
    """
    if isinstance(controller, TableParameters):
        return tune_table(controller, settings, progress=progress, **changes)
    settled = settings_of(str(settings), changes)
    parameters: LawParameters
    kind, parameters = load_variant("controller", str(controller), CONTROLLERS)
    start = gains_of(parameters, settled["fixed"])
    with Progress("tune", progress) as bar:
        cost = Cost(load_setup(settled["plant"]), settled, str(controller))
        before = cost(start)
        evaluations = int(settled["evaluations"])

        def done(count: int, best: float) -> None:
            bar(f"cost {before:.4f} → {best:.4f}", count / evaluations)

        found, _ = closed_loop.tune(start, cost, evaluations=evaluations, done=done)
        gains = rounded(found)
        after = cost(gains)
    if after > before:
        gains, after = start, before
    return TunedController(kind, parameters.replace(**gains), start, gains, before, after, settled)


def check_target(path: Path, force: bool) -> None:
    """Refuse a file that cannot become a configuration: before the work, not after it."""
    if path.suffix not in (".yaml", ".yml"):
        raise ShakeError(f"--out {path}: must end in .yaml")
    refuse_existing(path, force=force)


def settings_of(name: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a file with some keys changed; checked."""
    path = find("tune", name)
    settings = strict(read_yaml(path), KEYS, str(path))
    settings |= {key: value for key, value in changes.items() if value is not None}
    strict(settings, KEYS, "tune")
    if settings["model"] not in MODELS:
        raise unknown_name("model", settings["model"], MODELS, str(path))
    if settings["perturbed"] < 0:
        raise ShakeError(f"perturbed = {settings['perturbed']}: must not be negative")
    if settings["evaluations"] < 1:
        raise ShakeError(f"evaluations = {settings['evaluations']}: must be at least 1")
    return settings


def gains_of(parameters: LawParameters, fixed: Sequence[str]) -> dict[str, float]:
    """The gains to be tuned: live numbers that are not zero and not among the fixed ones."""
    live = [f.name for f in dataclasses.fields(parameters) if f.metadata.get("live") and f.name not in fixed]
    found = {name: getattr(parameters, name) for name in live}
    gains = {name: float(v) for name, v in found.items() if isinstance(v, float) and v != 0.0}
    if not gains:
        raise ShakeError("tune: the configuration has no gain that is not zero")
    return gains


def section(course: Course, begin: float, seconds: float, dt: float) -> Course:
    """The part of a course that is tuned on; it starts where the reference is slow."""
    first = round(begin / dt)
    states = course.states[: first + round(seconds / dt)]
    if len(states) <= first:
        raise ShakeError(f"reference '{course.name}' is shorter than {begin:g} s")
    return dataclasses.replace(course, states=states)


class Cost:
    """The cost of a set of gains of the law of a configuration; `change` is made to each of its loops."""

    def __init__(
        self,
        setup: Setup,
        settings: dict[str, Any],
        controller: str,
        change: Callable[[Loop], Loop] = lambda loop: loop,
    ) -> None:
        self._settings = settings
        dt = setup.sample_time
        self._first = round(settings["begin"] / dt)
        courses = [
            section(c, settings["begin"], settings["seconds"], dt) for c in setup.courses(settings["references"])
        ]
        entry = Combination("", controller, settings["observer"], settings["model"])
        delay = int(setup.settings["delay"])
        self._loops = [
            setup.loop(entry, course, load, setup.table(load), delay)
            for load in settings["loads"]
            for course in courses
        ]
        self._loads = len(self._loops)
        self._loops += [
            setup.loop(entry, courses[i % len(courses)], load, table, 0)
            for i, (load, table) in enumerate(setup.perturbed(settings["perturbed"], settings["seed"]))
        ]
        self._loops = [change(loop) for loop in self._loops]
        law = self._loops[0].controller
        self._kind, self._parameters, self._dt = law.kind, law.parameters, dt
        self._model = setup.model(setup.settings["model_load"]) if settings["model"] != "none" else None

    def _judge(self, _: int, run: ClosedLoop) -> float:
        first = self._first
        part = dataclasses.replace(
            run, reference=run.reference[first:], truth=run.truth[first:], command=run.command[first:]
        )
        wanted = (self._settings[name] for name in ("travel_price", "position_weight", "acceleration_price"))
        return min(closed_loop.normalised_cost(part, *wanted), closed_loop.LOST)

    def __call__(self, gains: dict[str, float]) -> float:
        """Mean over loads and references, and the worst perturbed table (6.42)."""
        law = Controller(self._kind, self._parameters.replace(**gains), self._dt, self._model)
        costs = run_batch([dataclasses.replace(loop, controller=law) for loop in self._loops], self._judge)
        costs = [value if value == value else closed_loop.LOST for value in costs]
        return closed_loop.mean_and_worst(costs[: self._loads], costs[self._loads :], self._settings["robustness"])


def rounded(gains: dict[str, float]) -> dict[str, float]:
    """Four digits, as they are written."""
    return {name: float(f"{value:.4g}") for name, value in gains.items()}
