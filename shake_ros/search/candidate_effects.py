"""Effects as candidates: which of their parameters a refit frees and at which finite values they are first tried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, replace
from typing import Any

from shake_ros.fit.free_parameters import FreeParameter, free_parameter
from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.quantities import ShakeError, shown, strict_keys

OPTIONAL = {"usual", "narrow"}


@dataclass(frozen=True)
class CandidateEffect:
    """One effect that may be missing.

    effect : its name. free : the parameters a refit frees. trials : values by dotted name, the strength first.
    place, depends_on : where it acts and on what. usual : values met on real tables by dotted name.
    """

    effect: str
    free: tuple[FreeParameter, ...]
    trials: tuple[Mapping[str, float], ...]
    place: str
    depends_on: tuple[str, ...]
    usual: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def strength(self) -> FreeParameter:
        """The parameter whose neutral value makes the effect absent."""
        return self.free[0]

    @property
    def narrow(self) -> bool:
        """Whether its valley is so narrow that a fit of free runs comes to it by slow motion first."""
        return self.strength.narrow

    @property
    def neutral(self) -> float:
        """Value of the strength at which the effect is absent."""
        return float(getattr(EFFECTS[self.effect](), self.strength.name.rpartition(".")[2]))

    @property
    def signed(self) -> bool:
        """Whether the strength may lie on both sides of its neutral value."""
        return self.strength.low < self.neutral < self.strength.high


def candidates(
    content: Mapping[str, Any], where: str, model: str = "full", fields: Mapping[str, Field[Any]] = FIELDS
) -> tuple[CandidateEffect, ...]:
    """Candidates from the content of a file of config/discovery for a declared model with these fields; strict."""
    result = []
    for effect, entry in strict_keys(content, EFFECTS, where, kind="effect").items():
        if model not in EFFECTS[effect].models:
            continue
        if not isinstance(entry, Mapping) or set(entry) - OPTIONAL != {"free", "trials"}:
            more = "may have " + ", ".join(sorted(OPTIONAL))
            raise ShakeError(f"{where}: {effect}: needs the keys 'free' and 'trials', {more}")
        prefix = f"effects.{effect}."
        trials = tuple({prefix + name: float(v) for name, v in trial.items()} for trial in entry["trials"])
        own = [name for name in fields if name.startswith(prefix)]
        for trial in trials:
            strict_keys(trial, own, where)
        try:
            usual = {prefix + name: (float(low), float(high)) for name, (low, high) in entry.get("usual", {}).items()}
        except (AttributeError, TypeError, ValueError):
            raise ShakeError(f"{where}: {effect}: usual: needs [low, high] for each name") from None
        strict_keys(usual, own, where)
        narrow = entry.get("narrow", False)
        if not isinstance(narrow, bool):
            raise ShakeError(f"{where}: {effect}: narrow: {shown(narrow)} is neither true nor false")
        read = (free_parameter(prefix + name, c, where, fields) for name, c in entry["free"].items())
        free, kind = tuple(replace(p, narrow=narrow) for p in read), EFFECTS[effect]
        result.append(CandidateEffect(effect, free, trials, kind.place, kind.depends_on, usual))
    return tuple(result)


def scaled(candidate: CandidateEffect, table: TableParameters, reference: TableParameters) -> CandidateEffect:
    """A candidate whose trials, scales and bounds fit a table of another mass and area than those they are given for.

    Masses and forces count with the moved mass, flows and volumes with the area; lengths, times and pressures stay.
    A mass is a part of the moved one also where a fit moves that: a specimen cannot weigh more than all that moves.
    """
    mass = table.moved_mass / reference.moved_mass
    area = table.body.piston_area / reference.body.piston_area

    def factor(unit: str) -> float:
        above, _, below = unit.partition("/")
        if "m^3" in above:
            return area
        if "m^3" in below:
            return 1.0 / area
        return mass if {"kg", "N"} & set(above.split("*")) else 1.0 / mass if "N" in below else 1.0

    def fitting(p: FreeParameter) -> FreeParameter:
        by, limits = factor(p.unit), FIELDS[p.name].metadata
        low, high = max(by * p.low, limits["low"]), min(by * p.high, limits["high"])
        follows = table.moved_mass if p.unit == "kg" else 0.0
        return replace(p, scale=by * p.scale, low=low, high=high, moved_mass=follows)

    def tried(trial: Mapping[str, float]) -> dict[str, float]:
        limits = {name: FIELDS[name].metadata for name in trial}
        return {n: min(max(factor(m["unit"]) * trial[n], m["low"]), m["high"]) for n, m in limits.items()}

    return replace(candidate, free=tuple(map(fitting, candidate.free)), trials=tuple(map(tried, candidate.trials)))
