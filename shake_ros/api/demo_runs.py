"""The demo's simulated table with its hidden effect, and its recorded runs over DDS."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from shake_ros.api.progress import Progress
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.recordings import TableRecording
from shake_ros.settings import find, load_table, read_yaml

DURATION = {"excitation": 11.0, "earthquake": 12.0}  # of the recordings [s]
RUNS = ("excitation", "earthquake", "earthquake_again")  # recorded, each with sensor noise of its own


@dataclass(frozen=True)
class Hidden:
    """The simulated table and the effect in it that is not told to the fit."""

    effect: str
    table: TableParameters
    seed: int


def hide(settings: Mapping[str, Any], seed: int, effect: str | None) -> Hidden:
    """Draw a table of its own from the seed, with one hidden effect."""
    if seed < 0:
        raise ShakeError(f"--seed {seed}: must not be negative")
    rng = np.random.default_rng(seed)
    table = load_table(settings["declared"])
    values = dict(settings["numerics"])
    for name, (low, high) in settings["spread"].items():
        values[name] = table.value(name) * math.exp(rng.uniform(math.log(low), math.log(high)))
    names = sorted(settings["hidden"])
    chosen = effect or names[int(rng.integers(len(names)))]
    if chosen not in settings["hidden"]:
        raise unknown_name("hidden effect", chosen, names)
    values.update({f"effects.{chosen}.{k}": v for k, v in settings["hidden"][chosen].items()})
    return Hidden(chosen, table.with_values(values), seed)


def record_run(
    work: Path, name: str, settings: Mapping[str, Any], hidden: Hidden, model: str | Path, bar: Progress
) -> Path:
    """One recorded run over DDS with observer and controller carrying `model`; returns the bag's folder.

    Parameters
    ----------
    work : folder of the bag and of what the run needs. model : a name of config/table, or the path of a file.
    """
    from shake_ros.ros.graph import Experiment, record

    carried = str(model.resolve()) if isinstance(model, Path) else model  # a relative one would lie beside these files
    role = "excitation" if name == "excitation" else "earthquake"
    paths = {}
    for kind in ("observer", "controller"):
        content = {**read_yaml(find(kind, settings[kind])), "model": carried}
        paths[kind] = work / f"{kind}_{name}.yaml"
        paths[kind].write_text(yaml.safe_dump(content), encoding="utf-8")
    experiment = Experiment(
        str(work / "hidden_table.yaml"),
        settings[role],
        str(paths["observer"]),
        str(paths["controller"]),
        seed=len(RUNS) * hidden.seed + RUNS.index(name),
        duration=DURATION[role],
    )
    record(experiment, work / name, lambda part: bar(f"{name} over DDS", part))
    return work / name


def tracking(recording: TableRecording) -> dict[str, float]:
    """Relative tracking error of the true motion of a recording: position, velocity, acceleration."""
    assert recording.reference is not None and recording.truth is not None
    good = np.all(np.isfinite(recording.reference), axis=1) & np.all(np.isfinite(recording.truth), axis=1)
    reference, truth = recording.reference[good], recording.truth[good]
    error = np.sqrt(np.mean((truth - reference) ** 2, axis=0)) / np.std(reference, axis=0)
    return dict(zip(("position", "velocity", "acceleration"), error.tolist(), strict=True))
