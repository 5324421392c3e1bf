"""Every kind of function that is on no list, on a declared, an unknown and a reduced model, to a whole report.

The tables are the package's own with that function in them: what counts here is that each report comes to its end.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import shake_ros as sr
from shake_ros.api import model as opening
from shake_ros.api import tune_table
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.start.stages import StartingPoint
from shake_ros.physics.effects.unlisted import NODES
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.repair import close_loop as closing
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.search.decision import ForwardStep, Refit
from shake_ros.search.declared_fit import fit_declared
from shake_ros.search.problem import ModelStructure, SearchProblem, linearised
from shake_ros.search.refined_nodes import refined_function
from shake_ros.search.selection import Selection
from shake_ros.search.unlisted_functions import (
    KINDS,
    NODE_NAMES,
    PREFIX,
    PULSATION,
    UNLISTED,
    FunctionKind,
    best_function,
    fit_function,
    fit_to_pieces,
    may_have_functions,
    pulsations,
    ranges,
    screen_function,
)
from shake_ros.search.verdict import EffectVerdict, verdict_of
from shake_ros.settings import load_content, load_search, load_table

STEP, SECONDS = 0.001, 1.2
LEAN = load_search().replace(converging_evaluations=2, continued_evaluations=4, most_refitted=1)
SPANS = {"position": 0.02, "velocity": 0.5, "valve_opening": 0.6, "load_pressure": 6e6, "time": SECONDS, "phase": 0.16}
STRENGTHS = {"N": 1500.0, "-": 0.3, "m^3/s": 3e-5}
FREE = ("friction.coulomb_level", "friction.viscous", "bulk_modulus.modulus")
NAMES = {f"{k.place}_of_{k.quantity}_{k.code}": k for k in KINDS.values()}
FIRST = (  # one of each way through the report; the others are of the second tier
    ("declared", "valve_of_valve_opening_4"),
    ("declared", "supply_of_phase_8"),
    ("unknown", "friction_of_velocity_3"),
    ("reduced", "force_of_position_1"),
)
CASES = [
    pytest.param(m, k, id=f"{m}-{n}", marks=[] if (m, n) in FIRST else pytest.mark.second_tier)
    for m in ("declared", "unknown", "reduced")
    for n, k in NAMES.items()
]


def table_with(kind: FunctionKind) -> TableParameters:
    """The catalogue's table with a bump of one kind, as narrow as three nodes."""
    span = SPANS[kind.quantity]
    low, high = (0.0 if kind.quantity in ("time", "phase") else -span), span
    bump = np.exp(-0.5 * ((np.arange(NODES) - 0.6 * NODES) / 1.5) ** 2)
    nodes = dict(zip(NODE_NAMES, STRENGTHS[kind.unit] * bump, strict=True))
    own = {PREFIX + "kind": kind.code, PREFIX + "low": low, PREFIX + "high": high}
    return load_table("bergamo").with_values(own | nodes)


def recorded(table: TableParameters, name: str, seed: int) -> sr.Recordings:
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS / STEP)) * STEP
    frequency = np.arange(1.0, 12.0, 0.5)
    command = np.sin(2.0 * np.pi * np.outer(time, frequency) + rng.uniform(0.0, 6.3, len(frequency))) @ (1 / frequency)
    command *= 0.5 / np.max(np.abs(command))
    out = run(table, command, STEP)
    noise = rng.standard_normal((2, len(time)))
    return sr.recording(name, time, command, out[:, 0] + 8e-6 * noise[0], acceleration=out[:, 2] + 0.05 * noise[1])


def open_table(path: Path) -> Path:
    """The catalogue's table with a few numbers left open."""
    content: dict[str, Any] = load_table("bergamo").to_mapping()
    for name in FREE:
        section, field = name.split(".")
        content[section][field] = {"value": content[section][field], "sd": 0.1 * abs(content[section][field])}
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def search_for(kind: FunctionKind) -> Any:
    """A search that adds one kind of function, as the whole search would after trying all else."""

    def search(problem: SearchProblem, declared: Fit, *_: object) -> tuple[SearchProblem, Selection]:
        pieces, current = problem.estimation_pieces, problem.scored(declared)
        if not may_have_functions(current):
            return problem, Selection(current, (), current, functions=best_function(problem, current))
        model = linearised(pieces, declared)
        if kind is PULSATION:
            (found,) = pulsations(pieces, model, problem.settings)
        else:
            span = ranges(pieces, model)[kind.quantity]
            found = screen_function(pieces, model, kind, span, problem.settings)
        fitted = problem.scored(fit_function(problem, found, fit_to_pieces(problem, found)))
        own = tuple(p for p in found.free.free if p.name not in declared.free.names)
        chosen = Refit(CandidateEffect(UNLISTED, own, (), kind.place, kind.depends_on), fitted, found.gain)
        step = refined_function(problem, ForwardStep(chosen, (chosen,)))
        return problem, Selection(current, (step,), step.chosen.result)

    return search


def kept(
    problem: SearchProblem, found: Selection, *_: object
) -> tuple[Selection, tuple[EffectVerdict, ...], tuple[()]]:
    """How sure the function is; it stays in any case."""
    return found, tuple(verdict_of(problem, found, step)[0] for step in found.steps), ()


@pytest.mark.parametrize(("model", "kind"), CASES)
def test_unlisted_effect_ends_in_a_whole_report(
    model: str, kind: FunctionKind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = search_for(kind)

    def from_declared(problem: SearchProblem, model: ModelStructure, *_: object) -> tuple[SearchProblem, Selection]:
        return search(problem, fit_declared(problem, FreeParameters(model.table, model.free)).fit)

    monkeypatch.setattr(closing, "searched", from_declared)
    monkeypatch.setattr(closing, "with_verdicts", kept)
    monkeypatch.setattr(tune_table, "neighbours", lambda table, *_: [table])
    content, path = load_content("robust_tuning", "default", tune_table.KEYS)
    monkeypatch.setattr(tune_table, "load_content", lambda *_: ({**content, "reference": "pulse"}, path))
    monkeypatch.setattr(
        opening, "staged_start", lambda m, free, effects, data, _: StartingPoint.declared(m.table, data)
    )
    table = table_with(kind)
    config = open_table(tmp_path / "open.yaml") if model == "unknown" else None
    declared = sr.model("reduced" if model == "reduced" else "full", config)
    learn = recorded(table, "first", 1) + recorded(table, "second", 2)
    found = sr.close_loop(declared, learn, recorded(table, "third", 3), settings=LEAN, progress=False)
    out = found.report(tmp_path / "out")
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert content["failed"] == []
    files = {"report.html", "report.json", "table.yaml", "diagnosis.json"}
    if model == "reduced":  # it has no place for such a function
        assert content["remaining"]["above_noise"]
    else:
        assert [step["effect"] for step in content["steps"]] == ["unlisted"]
        assert content["function"]["place"] == kind.place
        files |= {"tracking.json", "uncertainty.json"}
    assert {p.name for p in out.iterdir()} == files
    assert str(found)
