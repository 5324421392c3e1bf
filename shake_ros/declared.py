"""What a declared model takes from config/: its table, the parameters a fit may move, the effects it may lack."""

from __future__ import annotations

from collections.abc import Mapping

from shake_ros.core.discovery.candidates import CandidateEffect, candidates
from shake_ros.core.discovery.problem import ModelStructure
from shake_ros.core.identification import experiments
from shake_ros.core.identification.free_parameters import FreeParameter, free_parameter
from shake_ros.core.identification.recordings import FULL, DeclaredModel
from shake_ros.core.identification.reduced_model import REDUCED
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.quantities import ShakeError
from shake_ros.settings import find, load_table, read_yaml

DEFAULT_TABLE = "bergamo"


def free_parameters(model: DeclaredModel = FULL) -> list[FreeParameter]:
    """The parameters that a fit may move from its start, from config/identification."""
    return _parameters(model, late=False)


def late_parameters(model: DeclaredModel = FULL) -> list[FreeParameter]:
    """Those that it may move only once they explain much of what is left above the noise."""
    return _parameters(model, late=True)


def _parameters(model: DeclaredModel, late: bool) -> list[FreeParameter]:
    path = find("identification", model.name)
    entries = {n: dict(c) for n, c in read_yaml(path).items()}
    fields = model.layout.fields
    return [free_parameter(n, c, str(path), fields) for n, c in entries.items() if c.pop("late", False) is late]


def effect_candidates(model: DeclaredModel = FULL) -> tuple[CandidateEffect, ...]:
    """Every effect that the model may lack, with its trials, from config/discovery."""
    path = find("discovery", model.candidates_file)
    return candidates(read_yaml(path), str(path), model.name, model.layout.fields)


def model_structure(table: TableParameters, model: DeclaredModel = FULL) -> ModelStructure:
    """A table of a model with what a fit may move and the effects that it may lack."""
    free, late = tuple(free_parameters(model)), tuple(late_parameters(model))
    return ModelStructure(table, free, late, effect_candidates(model), model)


def recordings_to_make() -> tuple[experiments.Candidate, ...]:
    """The catalogue of recordings of which the most helpful is named, from config/experiment."""
    path = find("experiment", "catalogue")
    return experiments.catalogue(read_yaml(path), str(path))


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
        if isinstance(content, Mapping) and all(key in (*FULL_LAYOUT.sections, "effects") for key in content):
            return None  # a table whose hydraulics tell no β
        raise ShakeError(f"{path}: expected a reduced table with the section 'dynamics', or the sections of a table")
    return model.layout.table(content, str(path))
