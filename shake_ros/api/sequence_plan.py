"""The plan of a sequence of qualification tests: its levels in turn, from config/qualification_sequences."""

from __future__ import annotations

from dataclasses import dataclass

from shake_ros.core.quantities import Parameters, ShakeError, choice, quantity, strict_keys
from shake_ros.settings import find, read_yaml

PLANS = "qualification_sequences"
KEYS = ("name", "source", "levels", "interlock")


@dataclass(frozen=True)
class Level(Parameters):
    """Tests of one level."""

    name: str = choice("of the level, a part of a folder's name")
    share: float = quantity("-", "of the required spectrum", low=0.01, high=1.0)
    tests: int = quantity("-", "how many", low=1, high=100)


@dataclass(frozen=True)
class Stage:
    """One test of a plan: its name, share of the spectrum, and whether resonances are sought before and after it."""

    name: str
    share: float
    searches: tuple[bool, bool]


@dataclass(frozen=True)
class Plan:
    """Content of config/qualification_sequences."""

    name: str
    source: str
    levels: tuple[Level, ...]
    interlock: str

    @property
    def stages(self) -> tuple[Stage, ...]:
        """Its tests in turn; resonances are sought before the first one and after each level."""
        found = [
            (f"{number}_{level.name}_{k + 1}", level.share, k + 1 == level.tests)
            for number, level in enumerate(self.levels, start=1)
            for k in range(level.tests)
        ]
        return tuple(Stage(name, share, (k == 0, last)) for k, (name, share, last) in enumerate(found))


def load_plan(name: str) -> Plan:
    """config/qualification_sequences/<name>.yaml, or a YAML file; ShakeError for wrong content."""
    path = find(PLANS, name)
    content = strict_keys(read_yaml(path), KEYS, str(path), KEYS, kind="key")
    if not isinstance(content["levels"], list) or not content["levels"]:
        raise ShakeError(f"{path}: levels: a list of {{name, share, tests}} is needed")
    levels = tuple(Level.from_mapping(row, f"{path}: level {k}") for k, row in enumerate(content["levels"], start=1))
    for level in levels:
        if not level.name.replace("_", "").isalnum():
            raise ShakeError(f"{path}: level '{level.name}': letters, digits and _ make a folder's name")
    find("interlock", str(content["interlock"]))
    return Plan(str(content["name"]), str(content["source"]), levels, str(content["interlock"]))
