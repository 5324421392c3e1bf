"""What does close_loop name on tables of which nothing is known, when the truth is? What two studies measure.

    ./shake campaign foreign --out DIR
    ./shake campaign foreign_nothing --out DIR

Tables of foreign_tables.py, none to four effects hidden in each or none in any; three recordings to learn from, two
held out, in volts and with offsets of their own; `close_loop` with the model `unknown`, as `--minutes` would end it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.discovery import foreign_tables as foreign
from benchmarks.discovery.confusion import verdicts_of
from shake_ros.api.close_loop import close_loop
from shake_ros.api.model import model
from shake_ros.api.read import recording


def measure(
    seed: int, seconds: float, minutes: float, pressures: bool = False, most: int = max(foreign.COUNTS)
) -> dict[str, Any]:
    """One table: what was hidden and named, what was found but not named, errors over the noise.

    seconds : length of each recording. minutes : of one core, after which the search ends with its best answer so far.
    pressures : whether the load pressure is measured as well. most : effects hidden at most.
    """
    case = foreign.case_of(seed, most)
    runs, floor = {}, {}
    for name in foreign.RUNS:
        made = foreign.record(case, name, seconds, pressures=pressures)
        floor[name] = float(made.pop("noise") / np.std(made["acceleration"]))
        runs[name] = recording(name, **made)
    learn, hold = ([n for n in foreign.RUNS if n.startswith(role)] for role in ("learn", "hold"))
    data = ([runs[n][0] for n in role] for role in (learn, hold))
    found = close_loop(model("unknown"), *data, minutes=minutes, progress=False)
    named = found.effects.names
    over = {
        f"{which}_over_noise": float(np.mean([m.validation[n]["acceleration"] / floor[n] for n in hold]))
        for which, m in (("before", found.closed.baseline), ("after", found.closed.final))
    }
    return {
        "hidden": [
            {"effect": effect, "found": effect in named, "hidden_effects": len(case.effects)} for effect in case.effects
        ],
        "named": list(named),
        "alternatives": [list(e.alternatives) for e in found.effects],
        "verdicts": verdicts_of(found.closed, case.effects),
        "left_out": [{"effect": c.effect, "worth": c.worth, "reason": c.reason} for c in found.closed.candidates],
        "wrong_names": sum(name not in case.effects for name in named),
        "false_alarm": None if case.effects else bool(named),
        **over,
    }
