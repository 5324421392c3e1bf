"""What the twin follows: slow parameters of a found table, how far each may wander, and how the twin tests them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from shake_ros.core.identification.free_parameters import FreeParameter
from shake_ros.core.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.core.quantities import Parameters, ShakeError, quantity, strict_keys
from shake_ros.declared import effect_candidates, free_parameters, sized
from shake_ros.fit.model import SENSOR_DELAY, FreeModel, start_of
from shake_ros.settings import find, read_yaml

SUPPLY = FreeParameter("supply.supply_pressure", 1e6, 1e6, 1e8, "Pa")
SHAPES = ("frequency", "damping")  # of an effect, followed where the table has it


@dataclass(frozen=True)
class FollowedWander(Parameters):
    """How far a parameter goes without a fault, in parts of its value or of its scale, whichever is larger."""

    walk: float = quantity("-", "standard deviation of its change within an hour", low=0.0, high=100.0)
    model: float = quantity("-", "standard deviation of its estimate from motion to motion", low=0.0, high=100.0)


@dataclass(frozen=True)
class TwinTest(Parameters):
    """How the twin divides time and tests."""

    window: float = quantity("s", "motion from which one estimate is made", low=0.5, high=10.0)
    reference: float = quantity("s", "motion that shows what is normal", low=5.0, high=600.0)
    false_alarms: float = quantity("1/h", "false alarms of the test", low=1e-6, high=10.0)
    naming: float = quantity("s", "motion after a change from which it is named", low=1.0, high=60.0)


@dataclass(frozen=True)
class TwinSettings:
    """Content of a file of config/twin."""

    test: TwinTest
    parameters: Mapping[str, FollowedWander]


def load_twin(name: str = "default") -> TwinSettings:
    """config/twin/<name>.yaml, or a YAML file; ShakeError names file and key."""
    path = find("twin", name)
    own = [f.name for f in fields(TwinTest)]
    content = dict(strict_keys(read_yaml(path), [*own, "parameters"], str(path), [*own, "parameters"], kind="key"))
    known = [*FULL_LAYOUT.names, SENSOR_DELAY.name]
    given: Mapping[str, Any] = strict_keys(content.pop("parameters"), known, f"{path}: parameters")
    test = TwinTest.from_mapping(content, str(path))
    wander = {n: FollowedWander.from_mapping(c, f"{path}: {n}") for n, c in given.items()}
    if not wander:
        raise ShakeError(f"{path}: parameters: expected one at least")
    return TwinSettings(test, wander)


@dataclass(frozen=True)
class Followed:
    """A found table with what is followed of it.

    Attributes
    ----------
    model : its free parameters are those followed, in units of what `unit_of` says.
    sizes : of a change of each that matters, shape (p,) [units].
    walk : standard deviation of each within an hour, shape (p,) [units]. spread : from motion to motion, (p,) [units].
    """

    model: FreeModel
    sizes: np.ndarray
    walk: np.ndarray
    spread: np.ndarray


def followed(table: TableParameters, settings: TwinSettings) -> Followed:
    """What is followed of a found table.

    Raises
    ------
    ShakeError : the table has none of the parameters.
    """
    known = {p.name: p for p in (*free_parameters(), SUPPLY, SENSOR_DELAY)}
    candidates = sized(effect_candidates(), table)
    known |= {c.strength.name: c.strength for c in candidates}
    for effect in candidates:
        if effect.effect in table.effects:
            known |= {p.name: p for p in effect.free if p.name.rpartition(".")[2] in SHAPES}
    own = {name: p for name, p in known.items() if name in settings.parameters and _is_there(table, name)}
    if not own:
        raise ShakeError("the table has none of the parameters that the twin follows")
    free = [_in_units(own[name], table) for name in settings.parameters if name in own]
    wander = [settings.parameters[p.name] for p in free]
    sizes = np.array([own[p.name].scale / p.scale for p in free])
    return Followed(
        start_of(table, free), sizes, *(np.array([getattr(w, n) for w in wander]) for n in ("walk", "model"))
    )


def _is_there(table: TableParameters, name: str) -> bool:
    section, _, rest = name.partition(".")
    return section in ("effects", "sensor") or rest in {f.name for f in fields(table.sections[section])}


def _in_units(p: FreeParameter, table: TableParameters) -> FreeParameter:
    """The parameter with its value as its scale, where that is larger than the scale, and room to move."""
    value = 0.0 if p.name == SENSOR_DELAY.name else table.value(p.name)
    return FreeParameter(p.name, max(abs(value), p.scale), min(p.low, value), max(p.high, value), p.unit)
