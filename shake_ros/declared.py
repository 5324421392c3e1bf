"""The declared models, and what they take from config/: table, parameters a fit may move, effects they may lack.

A table's file may give a number as exact, as `{value: …, sd: …}` (a prior of the fit) or as `unknown`; with any of the
latter two it is one for the model `unknown`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shake_ros.explain import experiments
from shake_ros.fit.axis_model import AXIS
from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.free_parameters import FreeParameter, free_parameter, null_shifts_of
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.fit.start.stages import StartingPoint
from shake_ros.fit.start.unknown_model import NAME as UNKNOWN
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.search.candidate_effects import CandidateEffect, candidates, scaled
from shake_ros.search.problem import ModelStructure
from shake_ros.search.search_settings import SearchSettings
from shake_ros.settings import find, load_search, load_table, read_yaml, table_of

MODELS: dict[str, DeclaredModel] = {model.name: model for model in (FULL, REDUCED, AXIS)}
DEFAULT_TABLE = "bergamo"
UNSEEN = {"body.stroke": 1.0}  # what a table may leave open and no fit needs: so long that no end stop is met [m]
AGAINST_POSITION = ("accelerometer_lag", "accelerometer_scale", "position_sensor_lag")  # what only a position shows


def free_parameters(model: DeclaredModel = FULL, late: bool = False) -> list[FreeParameter]:
    """The parameters that a fit may move, from config/identification.

    Parameters
    ----------
    late : those that move only once they explain much of what is left above the noise, not those from the start.
    """
    path = find("identification", model.name)
    entries = {n: dict(c) for n, c in read_yaml(path).items()}
    fields = model.layout.fields
    found = [free_parameter(n, c, str(path), fields) for n, c in entries.items() if c.pop("late", False) is late]
    return [f for f in found if model.may_move(f.name)]


def effect_candidates(
    model: DeclaredModel = FULL, table: TableParameters | None = None, records: Sequence[Record] = ()
) -> tuple[CandidateEffect, ...]:
    """Every effect that the model may lack, with its trials, from config/discovery.

    Parameters
    ----------
    table : of the model, where its size is its own; the file's trials are made for DEFAULT_TABLE.
    records : of whose motion it has to show; without a position not all effects do.
    """
    path = find("discovery", model.candidates_file)
    found = candidates(read_yaml(path), str(path), model.layout.name, model.layout.fields)
    unseen = () if all(r.position_measured for r in records) else AGAINST_POSITION
    fitting = tuple(c for c in found if model.may_lack(c.effect) and c.effect not in unseen)
    return fitting if table is None or not model.nuisances else sized(fitting, table)


def sized(found: Iterable[CandidateEffect], table: TableParameters) -> tuple[CandidateEffect, ...]:
    """Candidates whose trials, scales and bounds fit a table of any size; the file's are made for DEFAULT_TABLE."""
    reference = load_table(DEFAULT_TABLE)
    return tuple(scaled(c, table, reference) for c in found)


def model_structure(begin: StartingPoint | TableParameters, model: DeclaredModel = FULL) -> ModelStructure:
    """Where a fit of a model begins, with what it may move and the effects that it may lack."""
    start = begin if isinstance(begin, StartingPoint) else StartingPoint.declared(begin, Prepared([], [], 1.0, ()))
    free, late = tuple(free_parameters(model)), tuple(free_parameters(model, late=True))
    if model.nuisances:
        free = (*free, *null_shifts_of(len({r.run for r in start.data.estimation}), free))
    effects = effect_candidates(model, start.fitted, start.data.estimation)
    begun = start.fitted, start.shown, start.between, start.unbent
    return ModelStructure(start.table, free, late, effects, model, *begun)


def search_settings(model: DeclaredModel = FULL) -> SearchSettings:
    """The thresholds of the search for what a model lacks."""
    return load_search(changes="search_unknown" if model.nuisances else None)


def recordings_to_make() -> tuple[experiments.Candidate, ...]:
    """The catalogue of recordings of which the most helpful is named, from config/experiment."""
    path = find("experiment", "catalogue")
    return experiments.catalogue(read_yaml(path), str(path))


def unknown_model(config: str = UNKNOWN) -> UnknownModel:
    """The model of a table's file with what it leaves open.

    Raises
    ------
    ShakeError : a number is left open that recordings do not determine.
    """
    path = find("table", config)
    starts = {name: dict(entry) for name, entry in read_yaml(find("identification", UNKNOWN)).items()}
    unknown, deviations = list[str](), dict[str, float]()

    def known(name: str, content: Any) -> Any:
        if isinstance(content, Mapping) and set(content) != {"value", "sd"}:
            return {key: known(f"{name}.{key}" if name else str(key), value) for key, value in content.items()}
        if content != UNKNOWN and not isinstance(content, Mapping):
            return content
        if content == UNKNOWN and name in UNSEEN:
            unknown.append(name)
            return UNSEEN[name]
        if name not in starts:
            raise ShakeError(
                f"{path}: {name}: recordings do not determine it: give a number (known to a fit: {', '.join(starts)})"
            )
        if isinstance(content, Mapping):
            try:
                deviations[name] = float(content["sd"])
            except (TypeError, ValueError):
                raise ShakeError(f"{path}: {name}: sd: expected a number") from None
            if not deviations[name] > 0.0:
                raise ShakeError(f"{path}: {name}: sd = {deviations[name]:g}: expected a number above 0")
            return content["value"]
        unknown.append(name)
        return starts[name].get("start", starts[name]["low"])

    table = FULL_LAYOUT.table(known("", read_yaml(path)), str(path))
    return UnknownModel(table, tuple(unknown), deviations)


def leaves_open(config: str) -> bool:
    """Whether a table's file leaves numbers open: `unknown`, or with a standard deviation."""

    def is_open(content: Any) -> bool:
        if isinstance(content, Mapping):
            return set(content) == {"value", "sd"} or any(is_open(value) for value in content.values())
        return bool(content == UNKNOWN)

    return is_open(read_yaml(find("table", config)))


def declared_table(model: DeclaredModel, config: str | None) -> TableParameters | None:
    """The table of a configuration; None where `first_table` of the recordings takes its place.

    Parameters
    ----------
    config : a name of config/table or a YAML file. Where None, the full model's is DEFAULT_TABLE.
    """
    if config is None:
        return load_table(DEFAULT_TABLE) if model is FULL else None
    path = find("table", config)
    content = read_yaml(path)
    if model is REDUCED and not (isinstance(content, Mapping) and "dynamics" in content):
        if isinstance(content, Mapping) and all(key in (*FULL_LAYOUT.sections, "effects", "fluid") for key in content):
            return None  # a table whose hydraulics tell no β
        raise ShakeError(f"{path}: expected a reduced table with the section 'dynamics', or the sections of a table")
    return table_of(content, str(path), model.layout)
