"""Which effects does close_loop name on declared tables that lack two or three at once? What a study measures.

    ./shake campaign several_effects --out DIR

Tables of hidden_tables.py, which shares nothing with the package; effects drawn by chance, every third table with a
backlash or a soft zone among them, each changing the acceleration by a drawn share.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks.discovery import hidden_tables as hidden
from benchmarks.discovery.confusion import left_open, verdicts_of
from shake_ros.api.close_loop import close_loop
from shake_ros.api.model import model
from shake_ros.api.read import recording

HARD = ("coupling_backlash", "soft_zone")
ALIKE = (  # of each of these a table has one at most: recordings can hardly distinguish them
    {"tank_back_pressure", "payload_error"},
    {"pressure_dependent_bulk_modulus", "entrained_air", "dead_volume"},
    {"slow_valve", "command_delay"},
)
SEVERITY = (0.1, 0.3)  # relative change of the acceleration by each effect


def drawn(seed: int) -> tuple[str, ...]:
    """Two or three effects, a hard one among them on every third table."""
    rng = np.random.default_rng([seed, 42])
    listed = [n for n, h in hidden.HIDDEN.items() if h.listed and n not in HARD]
    chosen = [HARD[seed // 3 % 2]] if seed % 3 == 0 else []
    count = int(rng.integers(2, 4))
    while len(chosen) < count:
        effect = str(rng.choice(listed))
        if effect not in chosen and not any({effect, other} <= group for other in chosen for group in ALIKE):
            chosen.append(effect)
    return tuple(chosen)


def truth(seed: int, effects: tuple[str, ...], commands: dict[str, np.ndarray]) -> hidden.Truth:
    """The table with these effects, one put on the other."""
    rng = np.random.default_rng([seed, 43])
    table = hidden.declared_truth(seed)
    for effect in effects:
        table = hidden.with_effect(table, effect, float(rng.uniform(*SEVERITY)), commands, seed)
    return table


def measure(seed: int, length: float, minutes: float, between_repeats: float = 0.0) -> dict[str, Any]:
    """One table: what was hidden and named, errors over the noise, seconds.

    Parameters
    ----------
    length : scale of the recordings' durations. minutes : of one core, after which the search is to end.
    between_repeats : of the acceleration, that a random force on the table makes of repeats of one command [-].
    """
    effects, commands = drawn(seed), hidden.excitations(seed, length)
    table = truth(seed, effects, commands)
    if between_repeats:
        table = hidden.with_random_force(table, between_repeats, commands)
    rng = np.random.default_rng([seed, 44])
    runs, floor = {}, {}
    for name, command in commands.items():
        made = hidden.record(table, command, 1.0, rng)
        times = np.arange(len(command)) * hidden.SAMPLE
        runs[name] = recording(name, times, made["command"], made["position"], acceleration=made["acceleration"])
        floor[name] = hidden.ACCELERATION_NOISE / float(np.std(made["acceleration"]))
    learn, hold = ([n for n in runs if n.startswith(role)] for role in ("learn", "hold"))
    data = ([runs[n][0] for n in role] for role in (learn, hold))
    began = time.perf_counter()
    found = close_loop(model("full"), *data, minutes=minutes, progress=False)
    named, final = found.effects.names, found.closed.final
    groups = [set(left_open([e.name, *e.alternatives])) for e in found.effects]
    return {
        "hidden": [{"effect": e, "found": e in named, "among": any(e in g for g in groups)} for e in effects],
        "named": list(named),
        "alternatives": [list(e.alternatives) for e in found.effects],
        "verdicts": verdicts_of(found.closed, effects),
        "left_out": [c.effect for c in found.closed.candidates],
        "wrong_names": sum(not group & set(effects) for group in groups),
        "whole_list": len(groups) == len(effects) and all(any(e in g for g in groups) for e in effects),
        "over_noise": float(np.mean([final.validation[n]["acceleration"] / floor[n] for n in hold])),
        "seconds": time.perf_counter() - began,
    }
