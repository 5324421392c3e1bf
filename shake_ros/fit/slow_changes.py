"""What changes so slowly on a force-driven axis that each recording has its own: level of friction, offset, drift.

    M v̇ = F − F_0 − b − d (t − t_m) − λ (friction of the axis)

Grease and amplifier warm up between recordings and within them, and a free run adds that up: 0.1 N beside 20 N of
friction moves a run of 25 s by millimetres. So every recording that is long enough has a drift d of its force, zero in
the mean about its middle t_m; and every one but the first that is learned from has an offset b and a level λ of all
friction, relative to that one. They are the least squares of its position error for whatever parameters are tried
(Gauss-Newton from d = 0, b = 0, λ = 1). They are no numbers of the axis. A recording held out has them as well: what is
shown of it with them is no forecast from its force alone, which `forecast_errors` of axis_model.py gives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shake_ros.fit.records import Record
from shake_ros.physics.effects.unlisted import CHANGES, FORCE_OF_VELOCITY, FRICTION_OF_POSITION, NODES
from shake_ros.physics.plant.axis import AXIS_LAYOUT

DRIFT, LEVEL, OFFSET = "drift", "level", "offset"
LONG = 10.0  # a drift shows in recordings that are long beside the seconds in which an axis settles [s]
ROUNDS = 3  # of Gauss-Newton, the last on the slopes of the one before; a drift alone needs one less
# Steps of the differences, which move a long run by millimetres [N/s], [-], [N]; and the largest values, in the force's
# deviation (per length of the recording) and in all friction: more is no slow change.
STEPS = {DRIFT: 1e-3, LEVEL: 2e-3, OFFSET: 1e-2}
LARGEST = {DRIFT: 0.1, LEVEL: 0.3, OFFSET: 0.1}
_INDEX = AXIS_LAYOUT.index
_KIND = _INDEX["effects.unlisted.kind"]
_NODES = [_INDEX[f"effects.unlisted.node_{i:02d}"] for i in range(NODES)]
_NODES += [_INDEX[f"effects.unlisted.{end}_{i}"] for end in ("above", "below") for i in range(CHANGES)]
_FRICTION = [
    _INDEX[name]
    for name in (
        "axis.viscous",
        "axis.coulomb",
        "effects.quadratic_drag.coefficient",
        "effects.position_dependent_friction.gradient",
        "effects.position_dependent_friction.curvature",
    )
]
Run = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SlowChange:
    """What one recording has of its own. level : of its friction [-]. offset [N] and drift [N/s] : of its force."""

    recording: str
    level: float = 1.0
    offset: float = 0.0
    drift: float = 0.0


def with_slow_changes(estimation: Sequence[Record], validation: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """The records with what each takes from itself, as the module says."""

    def own(record: Record, first: bool) -> Record:
        long = len(record.commands) * record.sample_time >= LONG
        return replace(record, own=() if not long else (DRIFT,) if first else (DRIFT, LEVEL, OFFSET))

    learned = [own(r, r.name == estimation[0].name) for r in estimation]
    return learned, [own(r, False) for r in validation]


def changed(
    vectors: np.ndarray, record: Record, names: Sequence[str], values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters, shape (m, k), and forces, (m, n) [N], under slow changes of some names, (m, len(names))."""
    vectors, forces = vectors.copy(), np.tile(record.commands, (len(vectors), 1))
    for name, value in zip(names, values.T, strict=True):
        if name == DRIFT:
            time = record.sample_time * (np.arange(forces.shape[1]) - 0.5 * (forces.shape[1] - 1))
            forces -= value[:, None] * time
        elif name == OFFSET:
            forces -= value[:, None]
        else:
            vectors[:, _FRICTION] *= 1.0 + value[:, None]
            of_friction = np.isin(vectors[:, _KIND], (FRICTION_OF_POSITION, FORCE_OF_VELOCITY))
            vectors[:, _NODES] *= np.where(of_friction, 1.0 + value, 1.0)[:, None]
    return vectors, forces


def found_changes(run: Run, vectors: np.ndarray, record: Record) -> np.ndarray:
    """Drift [N/s], level − 1 and offset [N] of a recording, those of record.own, for rows of parameters, (m, len(own)).

    Parameters
    ----------
    run : gives the positions, shape (m, n) [m], of rows of parameters and of forces.
    """
    names, m = record.own, len(vectors)
    found, step = np.zeros((m, len(names))), np.array([STEPS[name] for name in names])
    seconds = len(record.commands) * record.sample_time
    force = float(np.std(record.commands))
    unit = {DRIFT: force / seconds, OFFSET: force, LEVEL: 1.0}
    largest = np.array([LARGEST[n] * unit[n] for n in names])
    rounds = ROUNDS if LEVEL in names else ROUNDS - 1
    for k in range(rounds):
        reached = run(*changed(vectors, record, names, found))[:, record.start :]
        if k < max(rounds - 1, 1):
            tried = [run(*changed(vectors, record, names, found + row))[:, record.start :] for row in np.diag(step)]
            slopes = (np.array(tried) - reached) / step[:, None, None]
        error = record.position[record.start :] - reached
        for i in range(m):
            found[i] += np.linalg.lstsq(slopes[:, i].T, error[i], rcond=None)[0]
        found = np.clip(np.nan_to_num(found), -largest, largest)
    return found
