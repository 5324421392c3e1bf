"""tune: the gains of a controller that minimise (6.42) over loads and perturbed tables, as a new configuration."""

from __future__ import annotations

import argparse
import dataclasses
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from shake_ros.api.loops import MODELS, Course, Entry, Plant, load_plant, strict
from shake_ros.cli.progress import Bar
from shake_ros.core.control import CONTROLLERS
from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.control.law import LawParameters
from shake_ros.core.control.runner import Controller
from shake_ros.core.control.tuning import LOST, mean_and_worst, normalised_cost, tune
from shake_ros.core.loop.compiled import Loop, run_batch
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.settings import find, load_variant, read_yaml

KEYS = (
    "plant", "observer", "model", "references", "begin", "seconds", "loads", "perturbed", "seed", "robustness",
    "position_weight", "travel_price", "acceleration_price", "evaluations", "fixed",
)  # fmt: skip


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="tune", description=__doc__)
    p.add_argument(
        "controller", metavar="CONTROLLER", help="config/controller/NAME.yaml or a file: law and first gains"
    )
    p.add_argument("--out", type=Path, required=True, metavar="FILE", help="the new configuration, .yaml")
    p.add_argument("--settings", default="default", metavar="NAME", help="config/tune/NAME.yaml or a file")
    p.add_argument("--loads", type=float, nargs="+", metavar="KG", help="specimens")
    p.add_argument("--references", nargs="+", metavar="NAME", help="config/reference/NAME.yaml or files")
    p.add_argument("--observer", metavar="NAME", help="config/observer/NAME.yaml or a file")
    p.add_argument(
        "--model", choices=MODELS, help="feedforward of a virtual table: none, of each load, of a fixed load"
    )
    p.add_argument(
        "--perturbed", type=int, metavar="N", help="tables around the middle load, the worst of which counts"
    )
    p.add_argument("--evaluations", type=int, metavar="N", help="sets of gains that are tried, at most")
    p.add_argument("--force", action="store_true", help="overwrite FILE")
    return p


def settings_of(given: argparse.Namespace) -> dict[str, Any]:
    """The settings of the file with what the command line changes; checked."""
    path = find("tune", given.settings)
    settings = strict(read_yaml(path), KEYS, str(path))
    for name in ("loads", "references", "observer", "model", "perturbed", "evaluations"):
        if getattr(given, name) is not None:
            settings[name] = getattr(given, name)
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
    """The stretch of a course that is tuned on; it starts where the reference is slow."""
    first = round(begin / dt)
    states = course.states[: first + round(seconds / dt)]
    if len(states) <= first:
        raise ShakeError(f"reference '{course.name}' is shorter than {begin:g} s")
    return dataclasses.replace(course, states=states)


class Cost:
    """The cost of a set of gains of the law of a configuration; `change` is made to each of its loops."""

    def __init__(
        self,
        plant: Plant,
        settings: dict[str, Any],
        controller: str,
        change: Callable[[Loop], Loop] = lambda loop: loop,
    ) -> None:
        self._settings = settings
        dt = plant.sample_time
        self._first = round(settings["begin"] / dt)
        courses = [
            section(c, settings["begin"], settings["seconds"], dt) for c in plant.courses(settings["references"])
        ]
        entry = Entry("", controller, settings["observer"], settings["model"])
        delay = int(plant.settings["delay"])
        self._loops = [
            plant.loop(entry, course, load, plant.table(load), delay)
            for load in settings["loads"]
            for course in courses
        ]
        self._loads = len(self._loops)
        self._loops += [
            plant.loop(entry, courses[i % len(courses)], load, table, 0)
            for i, (load, table) in enumerate(plant.perturbed(settings["perturbed"], settings["seed"]))
        ]
        self._loops = [change(loop) for loop in self._loops]
        law = self._loops[0].controller
        self._kind, self._parameters, self._dt = law.kind, law.parameters, dt
        self._model = plant.model(plant.settings["model_load"]) if settings["model"] != "none" else None

    def _judge(self, index: int, run: ClosedLoop) -> float:
        first = self._first
        part = dataclasses.replace(
            run, reference=run.reference[first:], truth=run.truth[first:], command=run.command[first:]
        )
        wanted = (self._settings[name] for name in ("travel_price", "position_weight", "acceleration_price"))
        return min(normalised_cost(part, *wanted), LOST)

    def __call__(self, gains: dict[str, float]) -> float:
        """Mean over loads and references, and the worst perturbed table (6.42)."""
        law = Controller(self._kind, self._parameters.replace(**gains), self._dt, self._model)
        costs = run_batch([dataclasses.replace(loop, controller=law) for loop in self._loops], self._judge)
        costs = [value if value == value else LOST for value in costs]
        return mean_and_worst(costs[: self._loads], costs[self._loads :], self._settings["robustness"])


def text_of(kind: str, parameters: LawParameters, comment: Sequence[str]) -> str:
    """A controller's YAML with units and meanings."""
    lines = [f"# {line}" for line in comment] + [f"kind: {kind}"]
    for f in dataclasses.fields(parameters):
        value, unit = getattr(parameters, f.name), f.metadata.get("unit", "")
        if isinstance(value, str):
            if value:
                lines.append(f"{f.name}: {value}")
            continue
        note = f"{unit}, {f.metadata['meaning']}" if unit not in ("", "-") else str(f.metadata["meaning"])
        lines.append(f"{f'{f.name}: {value!r}':36s}# {note}")
    return "\n".join(lines) + "\n"


def rounded(gains: dict[str, float]) -> dict[str, float]:
    """Four digits, as they are written."""
    return {name: float(f"{value:.4g}") for name, value in gains.items()}


def run(given: argparse.Namespace, arguments: Sequence[str], tell: Callable[[str, float], None]) -> str:
    """Tune, write, and say what came of it."""
    if given.out.suffix not in (".yaml", ".yml"):
        raise ShakeError(f"--out {given.out}: must end in .yaml")
    if given.out.exists() and not given.force:
        raise ShakeError(f"{given.out}: exists already (--force replaces it)")
    settings = settings_of(given)
    kind, parameters = load_variant("controller", given.controller, CONTROLLERS)
    start = gains_of(parameters, settings["fixed"])
    cost = Cost(load_plant(settings["plant"]), settings, given.controller)
    before = cost(start)
    evaluations = int(settings["evaluations"])
    found, _ = tune(
        start,
        cost,
        evaluations=evaluations,
        done=lambda count, best: tell(f"cost {before:.4f} → {best:.4f}", count / evaluations),
    )
    gains = rounded(found)
    after = cost(gains)
    if after > before:
        gains, after = start, before
    comment = [
        f"./shake tune {shlex.join(arguments)}",
        f"cost {before:.4f} before, {after:.4f} after: mean over {len(settings['loads'])} loads and "
        f"{len(settings['references'])} references, worst of {settings['perturbed']} perturbed tables",
    ]
    try:
        given.out.write_text(text_of(kind, parameters.replace(**gains), comment), encoding="utf-8")
    except OSError as error:
        raise ShakeError(f"{given.out}: cannot be written ({error.strerror})") from None
    changes = [f"  {name:24s} {start[name]:12.4g} → {value:.4g}" for name, value in gains.items()]
    return "\n".join([f"cost {before:.4f} → {after:.4f}", *changes, f"written: {given.out}"])


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    with Bar("tune") as bar:
        text = run(given, list(arguments), bar)
    print(text)
    return 0
