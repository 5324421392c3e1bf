"""What the studies of config/studies list and measure: plain functions of a row's values.

`compare` runs each controller on each reference, load and perturbed table of config/compare; `tune` tunes the gains of
each controller on several draws of perturbed tables.
"""

from __future__ import annotations

import functools
from dataclasses import asdict
from typing import Any

from shake_ros.api.loops import Combination, Course, Setup, combinations, load_setup
from shake_ros.api.tune import tune
from shake_ros.control.closed_loop import run_batch
from shake_ros.control.metrics import judge
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import unknown_name

DECLARED = -1  # number of the table that is as declared


def rows(settings: str = "default") -> list[dict[str, Any]]:
    """Every combination on every reference and load, and on the perturbed tables with the references in turn."""
    setup = _setup(settings)
    references, loads = setup.settings["references"], setup.settings["loads"]
    cases = [(reference, load, DECLARED) for load in loads for reference in references]
    cases += [(references[i % len(references)], load, i) for i, (load, _) in enumerate(_perturbed(settings))]
    names = ("reference", "load", "table")
    return [
        {"settings": settings, "entry": entry.label, **dict(zip(names, case, strict=True))}
        for entry in combinations(setup)
        for case in cases
    ]


def loop(settings: str, entry: str, reference: str, load: float, table: int) -> dict[str, Any]:
    """The figures of one closed loop; not finite where it has none.

    Parameters
    ----------
    settings : config/compare.
    entry : label of a controller there.
    reference : config/reference.
    load : [kg].
    table : number of the perturbed table, −1 for the declared one.
    """
    setup, known = _setup(settings), {c.label: c for c in combinations(_setup(settings))}
    if entry not in known:
        raise unknown_name("controller", entry, known, setup.where)
    course = _course(settings, reference)
    run = _loop(setup, known[entry], course, load, table, settings)
    (metrics,) = run_batch(
        [run], lambda _, made: judge(made, course.part, run.controller.parameters.limit, run.table.body.stroke)
    )
    return asdict(metrics)


def _loop(setup: Setup, entry: Combination, course: Course, load: float, table: int, settings: str) -> Any:
    if table == DECLARED:
        return setup.loop(entry, course, load, setup.table(load), int(setup.settings["delay"]))
    return setup.loop(entry, course, load, _perturbed(settings)[table][1], 0)


@functools.cache
def _setup(settings: str) -> Setup:
    return load_setup(settings)


@functools.cache
def _course(settings: str, reference: str) -> Course:
    return _setup(settings).courses([reference])[0]


@functools.cache
def _perturbed(settings: str) -> list[tuple[float, TableParameters]]:
    setup = _setup(settings)
    return setup.perturbed(int(setup.settings["perturbed"]["count"]))


def gains(controller: str, settings: str, seed: int, evaluations: int) -> dict[str, Any]:
    """Cost before and after, and the gains.

    Parameters
    ----------
    controller : config/controller.
    settings : config/tune.
    seed : of the perturbed tables.
    evaluations : sets of gains that are tried, at most.
    """
    found = tune(controller, settings, progress=False, seed=seed, evaluations=evaluations)
    return {
        "before": found.before,
        "after": found.after,
        "ratio": found.after / found.before,
        "better": found.after < found.before,
        "gains": [
            {"gain": name, "value": value, "times the first": value / found.start[name]}
            for name, value in found.gains.items()
        ],
    }
