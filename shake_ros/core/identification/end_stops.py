"""Stretches in which a table stands at its end stop, or strikes it: no model foresees such an impact.

One impact in a held-out recording outweighs everything that a model gets right. Where the stroke is known these
stretches are left out, and what follows is a recording of its own, since nothing tells the pressures after an impact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shake_ros.core.analysis.stretches import stretches
from shake_ros.core.identification.recordings import SHORTEST, Record
from shake_ros.core.quantities import ShakeError

NEAR = 0.002  # part of the stroke by which a zero of the position may be wrong


def within_stroke(records: Sequence[Record], stroke: float) -> tuple[list[Record], tuple[str, ...]]:
    """The parts of recordings between the end stops, and a line on each recording that meets one.

    Parameters
    ----------
    stroke : full [m]; positions count from its middle.

    Raises
    ------
    ShakeError : nothing of a recording lies between the stops.
    """
    found, said = list[Record](), dict[str, float]()
    names = dict.fromkeys(r.name for r in records)
    for record in records:
        at = np.abs(record.position) >= (0.5 - NEAR) * stroke
        if not at.any():
            found.append(record)
            continue
        said[record.name] = max(said.get(record.name, 0.0), float(np.max(np.abs(record.position))))
        found += [record.part(s) for s in stretches(~at) if (s.stop - s.start) * record.sample_time >= SHORTEST]
    lines = []
    for name, farthest in said.items():
        used, whole = (sum(len(r.commands) * r.sample_time for r in rs if r.name == name) for rs in (found, records))
        lines.append(
            f"{name}: the position reaches {1e3 * farthest:.1f} mm, the end stop of a stroke of {1e3 * stroke:.0f} mm; "
            f"split there; {used:.1f} of {whole:.1f} s are used"
        )
    if lost := [name for name in names if not any(r.name == name for r in found)]:
        line = next(line for line in lines if line.startswith(f"{lost[0]}: "))
        raise ShakeError(f"{line}: is the stroke (body.stroke), or the zero of the position, right?")
    return found, tuple(lines)
