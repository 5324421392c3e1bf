"""What the twin knows of a found table before it moves: how far each number may be off and wander; how it tests."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from shake_ros.declared import effect_candidates, free_parameters, sized
from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.model import SENSOR_FILTER, FreeModel, start_of
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import Parameters, ShakeError, describe, quantity, strict_keys
from shake_ros.settings import load_content

SUPPLY = FreeParameter("supply.supply_pressure", 1e6, 1e6, 1e8, "Pa")


@dataclass(frozen=True)
class FollowedWander(Parameters):
    """How far a parameter is without a fault, in parts of its value or of its scale, whichever is larger."""

    file: float = quantity("-", "standard deviation of its number in a found table's file", low=0.0, high=100.0)
    walk: float = quantity("-", "standard deviation of its change within an hour; 0: it is held", low=0.0, high=100.0)
    least: float = quantity("-", "below which maintenance is due; 0: never", low=0.0, high=1.0, default=0.0)
    most: float = quantity("-", "above which maintenance is due; 0: never", low=0.0, high=1e3, default=0.0)

    def limits(self, value: float, unit: float) -> tuple[float, float]:
        """Lower and upper limit of a parameter with this value in the file; one of another unit lies about zero.

        >>> FollowedWander(file=0.1, walk=0.1, least=0.8, most=1.5).limits(4.0, 4.0)
        (3.2, 6.0)
        >>> FollowedWander(file=0.1, walk=0.1, most=1.5).limits(0.0, 2.0)
        (-3.0, 3.0)
        """
        high = self.most * unit if self.most else math.inf
        low = -high if unit != value else self.least * value if self.least else -math.inf
        return low, high


@dataclass(frozen=True)
class TwinTest(Parameters):
    """How the twin divides time and tests."""

    window: float = quantity("s", "motion from which one estimate is made", low=0.5, high=10.0)
    reference: float = quantity("s", "motion that shows what is normal", low=5.0, high=600.0)
    false_alarms: float = quantity("1/h", "false alarms of the test", low=1e-6, high=10.0)
    naming: float = quantity("s", "motion after a change from which it is named", low=1.0, high=60.0)
    matters: float = quantity(
        "-", "share of the acceleration that a change must move to be reported", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class TwinSettings:
    """Content of a file of config/twin."""

    test: TwinTest
    parameters: Mapping[str, FollowedWander]


def load_twin(name: str = "default") -> TwinSettings:
    """config/twin/<name>.yaml, or a YAML file; ShakeError names file and key."""
    content, path = load_content("twin", name, [*describe(TwinTest), "parameters"])
    known = [*FULL_LAYOUT.names, SENSOR_FILTER.name]
    given: Mapping[str, Any] = strict_keys(content.pop("parameters"), known, f"{path}: parameters")
    test = TwinTest.from_mapping(content, path)
    wander = {n: FollowedWander.from_mapping(c, f"{path}: {n}") for n, c in given.items()}
    if not wander:
        raise ShakeError(f"{path}: parameters: expected one at least")
    return TwinSettings(test, wander)


@dataclass(frozen=True)
class Followed:
    """A found table with what is followed of it."""

    # with what the reference shows free, in units of what `unit_of` says: the p followed parameters, then those that
    # are held from then on
    model: FreeModel
    sizes: np.ndarray  # of a change of each followed one that matters, shape (p,) [units]
    walk: np.ndarray  # standard deviation of each followed one within an hour, shape (p,) [units]
    file: np.ndarray  # standard deviation of every one in the table's file [units]


def followed(table: TableParameters, settings: TwinSettings) -> Followed:
    """What is followed of a found table.

    Raises
    ------
    ShakeError : the table has none of the parameters.
    """
    known = {
        n: FreeParameter(n, 0.0, *(f.metadata[k] for k in ("low", "high", "unit")))
        for n, f in FULL_LAYOUT.fields.items()
    }
    known |= {p.name: p for p in (*free_parameters(), *free_parameters(late=True), SUPPLY, SENSOR_FILTER)}
    candidates = sized(effect_candidates(), table)
    known |= {c.strength.name: c.strength for c in candidates}
    known |= {p.name: p for c in candidates for p in c.free[1:] if c.effect in table.effects}
    given = settings.parameters
    own = {n: known[n] for n in given if _is_there(table, known[n], given[n].walk > 0.0)}
    order = sorted(own, key=lambda n: given[n].walk == 0.0)
    walk = np.array([given[n].walk for n in order])
    if not np.any(walk):
        raise ShakeError("the table has none of the parameters that the twin follows")
    free = [_in_units(own[n], table) for n in order]
    p = int(np.count_nonzero(walk))
    sizes = np.array([own[f.name].scale / f.scale for f in free[:p]])
    return Followed(start_of(table, free), sizes, walk[:p], np.array([given[n].file for n in order]))


def _is_there(table: TableParameters, p: FreeParameter, walks: bool) -> bool:
    """Whether a table has a parameter; one that is held counts only where it is more than nothing."""
    section, _, rest = p.name.partition(".")
    if p.name == SENSOR_FILTER.name:
        return True
    if section != "effects" and rest not in {f.name for f in fields(table.sections[section])}:
        return False
    return p.scale > 0.0 if walks else table.value(p.name) > 0.0


def _in_units(p: FreeParameter, table: TableParameters) -> FreeParameter:
    """The parameter with its value as its scale, where that is larger than the scale, and room to move."""
    value = 0.0 if p.name == SENSOR_FILTER.name else table.value(p.name)
    return FreeParameter(p.name, max(abs(value), p.scale), min(p.low, value), max(p.high, value), p.unit)
