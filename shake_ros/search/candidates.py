"""What a model may lack, as data: listed effects, and functions of one quantity for what none of them explains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from shake_ros.fit.free_parameters import FreeParameter
from shake_ros.fit.model import TriedEffect
from shake_ros.fit.prediction import Predictor
from shake_ros.fit.solver import PredictorFit
from shake_ros.physics.effects.unlisted import FRICTION_FACTOR_OF_POSITION
from shake_ros.physics.plant.states import POSITION, PRESSURE_A, VELOCITY
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.unlisted_functions import NODE_NAMES, OF_HYDRAULICS, OF_MOTION, PREFIX, FunctionKind

UNLISTED = "unlisted"
NODE_DEVIATION, CURVATURE_DEVIATION = 20.0, 10.0  # weak: they decide only what the recordings leave open
SHAPES = 9  # smooth functions by whose combinations a kind is tried
SCALED = {"position_dependent_friction": ("gradient", "curvature")}


def listed(effect: CandidateEffect) -> TriedEffect:
    """A listed effect as a candidate."""
    prefix = f"effects.{effect.effect}."
    scaled = tuple(prefix + n for n in SCALED.get(effect.effect, ())) or (effect.free[0].name,)
    return TriedEffect(
        effect.effect,
        effect.free,
        tuple((t,) for t in effect.trials),
        effect.place,
        depends_on=effect.depends_on,
        scaled=scaled,
    )


def function(kind: FunctionKind, low: float, high: float) -> TriedEffect:
    """A function of a kind over a range, free on its nodes, tried by the first cosines over the range."""
    free = tuple(FreeParameter(n, kind.scale, kind.low, kind.high, kind.unit) for n in NODE_NAMES)
    at = np.linspace(0.0, np.pi, len(NODE_NAMES))
    own = {PREFIX + "kind": float(kind.code), PREFIX + "low": low, PREFIX + "high": high}
    shapes = tuple(
        own | dict(zip(NODE_NAMES, (kind.scale * np.cos(k * at)).tolist(), strict=True)) for k in range(SHAPES)
    )
    penalties: list[tuple[Mapping[str, float], float]] = [({n: 1.0}, NODE_DEVIATION) for n in NODE_NAMES]
    for a, b, c in zip(NODE_NAMES[:-2], NODE_NAMES[1:-1], NODE_NAMES[2:], strict=True):
        penalties.append(({a: 1.0, b: -2.0, c: 1.0}, CURVATURE_DEVIATION))
    factor = "factor of " if kind.code == FRICTION_FACTOR_OF_POSITION else ""
    return TriedEffect(
        UNLISTED,
        free,
        (shapes,),
        kind.place,
        penalties=tuple(penalties),
        depends_on=kind.depends_on,
        scaled=NODE_NAMES,
        title=f"{UNLISTED} {factor}{kind.place} of {kind.quantity}",
    )


def functions(fitted: PredictorFit) -> list[TriedEffect]:
    """Functions of every quantity, over the range that a model fitted by a predictor shows of it."""
    found: dict[str, tuple[float, float]] = {}
    assert isinstance(fitted.prediction, Predictor)
    for run in fitted.prediction.runs:
        s, column = run.segment, {int(c): i for i, c in enumerate(run.codes)}
        seen = {
            "position": run.path[:, column[POSITION]],
            "velocity": run.path[:, column[VELOCITY]],
            "load_pressure": 2.0 * run.path[:, column[PRESSURE_A]],
            "valve_opening": s.commands,
            "time": s.begin + np.arange(len(s.commands)) * s.dt,
        }
        for name, values in seen.items():
            low, high = float(values[s.start :].min()), float(values[s.start :].max())
            before = found.get(name, (low, high))
            found[name] = min(before[0], low), max(before[1], high)
    kinds: Iterable[FunctionKind] = (*OF_MOTION, *OF_HYDRAULICS)
    return [function(k, *found[k.quantity]) for k in kinds if found[k.quantity][0] < found[k.quantity][1]]
