"""Effects as candidates: which of their parameters a refit frees and at which finite values they are first tried."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, replace
from typing import Any

from shake_ros.fit.free_parameters import FreeParameter, free_parameter
from shake_ros.physics.effects import EFFECTS
from shake_ros.physics.plant.parameters import FIELDS, TableParameters
from shake_ros.quantities import ShakeError, strict_keys

OPTIONAL = {"usual", "together", "where_far", "narrow"}


@dataclass(frozen=True)
class CandidateEffect:
    """One effect that may be missing.

    effect : its name. free : the parameters a refit frees. trials : values by dotted name, the strength first.
    place, depends_on : where it acts and on what. usual : values met on real tables by dotted name.
    together : values from which it takes part in a fit with many effects at once; empty where it does not.
    where_far : the same where that fit stays far from the noise.
    narrow : values from the best of which a fit of its own sets out, where its valley is hardly met otherwise.
    """

    effect: str
    free: tuple[FreeParameter, ...]
    trials: tuple[Mapping[str, float], ...]
    place: str
    depends_on: tuple[str, ...]
    usual: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    together: Mapping[str, float] = field(default_factory=dict)
    where_far: Mapping[str, float] = field(default_factory=dict)
    narrow: tuple[Mapping[str, float], ...] = ()

    @property
    def strength(self) -> FreeParameter:
        """The parameter whose neutral value makes the effect absent."""
        return self.free[0]

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
        free = tuple(free_parameter(prefix + name, c, where, fields) for name, c in entry["free"].items())
        trials = tuple({prefix + name: float(v) for name, v in trial.items()} for trial in entry["trials"])
        own = [name for name in fields if name.startswith(prefix)]
        for trial in trials:
            strict_keys(trial, own, where)
        try:
            usual = {prefix + name: (float(low), float(high)) for name, (low, high) in entry.get("usual", {}).items()}
        except (AttributeError, TypeError, ValueError):
            raise ShakeError(f"{where}: {effect}: usual: needs [low, high] for each name") from None
        strict_keys(usual, own, where)
        together, where_far = (
            {prefix + name: float(v) for name, v in entry.get(key, {}).items()} for key in ("together", "where_far")
        )
        strict_keys({**together, **where_far}, own, where)
        narrow = _each_with_each(prefix, entry.get("narrow", {}), f"{where}: {effect}: narrow")
        for point in narrow[:1]:
            strict_keys(point, own, where)
        kind = EFFECTS[effect]
        result.append(
            CandidateEffect(effect, free, trials, kind.place, kind.depends_on, usual, together, where_far, narrow)
        )
    return tuple(result)


def _each_with_each(prefix: str, content: Any, where: str) -> tuple[Mapping[str, float], ...]:
    """Each of some values of a parameter with each of those of the others; none where there is no parameter."""
    try:
        values = {prefix + name: [float(v) for v in given] for name, given in content.items()}
    except (AttributeError, TypeError, ValueError):
        raise ShakeError(f"{where}: needs a list of numbers for each name") from None
    return tuple(dict(zip(values, point, strict=True)) for point in itertools.product(*values.values()) if values)


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

    return replace(
        candidate,
        free=tuple(map(fitting, candidate.free)),
        trials=tuple(map(tried, candidate.trials)),
        narrow=tuple(map(tried, candidate.narrow)),
    )
