"""`iterate`: the drive, or the model, of the next run from the acceleration that the last one missed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.fitted import Data, recordings
from shake_ros.api.iterated import Iterated
from shake_ros.api.simulated_table import SimulatedTable
from shake_ros.core.identification.recordings import Record
from shake_ros.core.iteration.drive import Iteration, Run, drive_from_best, error_in_band, verdict
from shake_ros.core.iteration.drive import iterate as corrected
from shake_ros.core.iteration.model import iterate_model, refit
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.data.recordings import TableRecording
from shake_ros.data.reference_file import build_program
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.settings import find, load_table, read_yaml

Array = NDArray[np.float64]
OTHER_LOAD = 0.02  # of the moved mass, from which a weighed specimen is another
Learn = Callable[[TableParameters, Sequence[Record]], TableParameters]


def iterate(
    wanted: str | Path,
    runs: Data,
    *,
    settings: str | Iteration = "default",
    model: str | TableParameters | None = None,
    refit: Sequence[str] | None = None,
) -> Iterated:
    """The next run of the same motion from the runs so far.

    Parameters
    ----------
    wanted : the motion that the table should make: a name of config/reference or a YAML file.
    runs : recordings of it, oldest first, each from the start of its reference, with imu and reference.
    settings : how a drive is corrected: a name of config/iteration, a YAML file, or the settings.
    model, refit : where given, the drive stays and this table, with these effects, is fitted to the last run.

    Raises
    ------
    ShakeError
        A recording lacks a topic or is too short, or sample times differ.

    Examples
    --------
    A run in which the table reached nine tenths of the wanted acceleration:

    >>> import numpy as np
    >>> import shake_ros as sr
    >>> from shake_ros.data.reference_file import build_program
    >>> wanted = np.array(build_program("earthquake_rock", 0.002).states)
    >>> time, rest = np.arange(len(wanted)) * 0.002, np.zeros(len(wanted))
    >>> run = sr.recording("run", time, rest, 0.9 * wanted[:, 0], acceleration=0.9 * wanted[:, 2], reference=wanted)
    >>> following = sr.iterate("earthquake_rock", run)
    >>> following.error
    run    error
    run  10.00 %
    >>> following.drive.shape == wanted.shape
    True
    """
    parameters = load_iteration(settings)
    found = recordings(runs)
    if not found:
        raise ShakeError("iterate: no recording of a run")
    learn, before = learning(model, refit)
    sample_time = round(found[0].sample_time, 7)
    target = build_program(str(wanted), sample_time).states[:, 2]
    made = [_run(recording, len(target), sample_time) for recording in found]
    missed = tuple(error_in_band(target, run.achieved, sample_time, parameters) for run in made)
    wrong = _growth(missed, parameters)
    carried = load_table(model) if isinstance(model, str) else model
    known: dict[str, Any] = {"wrong": wrong, "first_model": carried, "records": tuple(found.records()) if wrong else ()}
    if before is not None:
        fitted = learn(before, found[-1:].records())
        return Iterated(found.names, missed, sample_time, model=fitted, **known)
    drive, factor = drive_from_best(target, made, missed, sample_time, parameters)
    return Iterated(found.names, missed, sample_time, drive, factor, **known)


def iterate_simulated(
    wanted: str | Path,
    table: SimulatedTable | str = "bergamo",
    *,
    runs: int | None = None,
    settings: str | Iteration = "default",
    model: str | TableParameters | None = None,
    refit: Sequence[str] | None = None,
) -> Iterated:
    """Runs of one motion on a simulated table, each from what the last one missed, until nothing is gained.

    Parameters
    ----------
    wanted, settings, refit : as in `iterate`. table : the simulated table, or the name of its configuration.
    runs : most runs. model : of the feedforward and of an observer that has a model, with `refit` of the first run; the
        table as it is declared where not given. Without `refit` its specimen is weighed by the forces of the first run.

    Raises
    ------
    ShakeError
        A run left the finite numbers.
    """
    parameters = load_iteration(settings) if runs is None else load_iteration(settings).replace(runs=runs)
    played = SimulatedTable(table) if isinstance(table, str) else table
    carried = load_table(model) if isinstance(model, str) else model or played.declared
    learn, before = learning(carried, refit)
    first = np.array(build_program(str(wanted), played.sample_time).states)
    played.begin(first, parameters)
    dt = played.sample_time
    if before is not None:
        models, missed, reason = iterate_model(first[:, 2], before, played.record, learn, parameters)
    else:
        player = _Player(played, carried)
        references, missed, reason = corrected(first[:, 2], first, player.play, dt, parameters, player.learnt)
    names, best = tuple(f"run {k + 1}" for k in range(len(missed))), int(np.argmin(missed))
    known: dict[str, Any] = {
        "simulated": played,
        "reason": reason,
        "wrong": verdict(missed, parameters),
        "first_model": carried,
        "records": tuple(played.records),
    }
    if before is not None:
        return Iterated(names, tuple(missed), dt, model=models[best], **known)
    return Iterated(names, tuple(missed), dt, references[best], model=player.models[best], **known)


class _Player:
    """Plays drives under a model whose specimen is weighed after the first run.

    Attributes
    ----------
    models : that each run was made under.
    """

    def __init__(self, table: SimulatedTable, model: TableParameters) -> None:
        self.table, self.model, self.models = table, model, list[TableParameters]()

    def play(self, reference: Array, number: int) -> Array:
        """The accelerometer's record of a run."""
        self.models.append(self.model)
        return self.table.acceleration(self.model, reference, number)

    def learnt(self) -> bool:
        """Whether the first run's forces tell another specimen than the model has."""
        if len(self.models) > 1:
            return False
        weighed = self.table.weighed(self.model)
        changed = abs(weighed.moved_mass / self.model.moved_mass - 1.0) > OTHER_LOAD
        self.model = weighed if changed else self.model
        return changed


def _growth(missed: Sequence[float], parameters: Iteration) -> str:
    """That the runs given so far diverge; empty where they do not, or where a single one tells nothing."""
    text = verdict(missed, parameters) if len(missed) > 1 else ""
    return text if text.startswith("diverges") else ""


def load_iteration(settings: str | Iteration) -> Iteration:
    """Settings of config/iteration by name or file, or as given."""
    if isinstance(settings, Iteration):
        return settings
    path = find("iteration", settings)
    return Iteration.from_mapping(read_yaml(path), str(path))


def learning(
    model: str | TableParameters | None, effects: Sequence[str] | None
) -> tuple[Learn, TableParameters | None]:
    """`refit` of the declared parameters and those of named effects, and the model of the first run where wanted."""
    if effects is None:
        return lambda table, _: table, None
    if model is None:
        raise ShakeError("--refit: needs --model, the table that is fitted")
    free, known = free_parameters(), {c.effect: c for c in effect_candidates()}
    for effect in effects:
        if effect not in known:
            raise unknown_name("effect", effect, known, "--refit")
    chosen = [known[effect] for effect in effects]
    before = load_table(model) if isinstance(model, str) else model
    return lambda table, records: refit(table, free, chosen, records), before


def _run(recording: TableRecording, samples: int, sample_time: float) -> Run:
    """The played and the measured acceleration of a recording from the first sample of its reference on."""
    part, name = recording.longest, recording.name
    for topic, content in (("imu", part.acceleration), ("reference", part.reference)):
        if content is None:
            raise ShakeError(f"{name}: no topic {topic}")
    assert part.acceleration is not None and part.reference is not None
    known = np.flatnonzero(np.isfinite(part.reference).all(axis=1))
    first = int(known[0]) if known.size else len(part.time)
    played = part.reference[first : first + samples, 2]
    if len(played) < samples or not np.isfinite(played).all():
        raise ShakeError(f"{name}: {known.size} unbroken samples of the reference, the wanted motion has {samples}")
    if abs(part.sample_time - sample_time) > 1e-3 * sample_time:
        raise ShakeError(
            f"{name}: a sample every {part.sample_time:g} s, the recordings before every {sample_time:g} s"
        )
    return Run(played, part.acceleration[first : first + samples])
