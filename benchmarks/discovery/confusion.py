"""Which effect does close_loop name when the truth is known? What the study `confusion` measures.

    ./shake campaign confusion --out DIR

Tables with one undeclared effect each, made by hidden_tables.py, which shares nothing with the package: every listed
effect, four that are on no list, and nothing at all, at severities of about 3, 10 and 30 % of the acceleration, over
seeds and noise levels. config/studies/confusion.yaml has the rows and the tables; config/studies/hit_rates.yaml is the
large one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.fitted import names_of
from shake_ros.api.progress import Ending, Progress
from shake_ros.declared import effect_candidates, model_structure
from shake_ros.fit.records import Record
from shake_ros.fit.start.data_checks import within_stroke
from shake_ros.repair.close_loop import LoopClosure, close_loop
from shake_ros.report.report_json import close_loop_json
from shake_ros.search.candidate_effects import CandidateEffect
from shake_ros.settings import load_search, load_table

NONE = "none"
LARGEST_GROUP = 3  # effects that a right answer may leave open


def measure(
    effect: str,
    seed: int,
    noise: float,
    severity: float = 0.0,
    strength: float | None = None,
    length: float = 1.0,
    among: Sequence[str] = (),
    minutes: float | None = None,
) -> dict[str, Any]:
    """Close the loop on one table.

    Parameters
    ----------
    effect : that is hidden, or "none". seed : of the table. noise : of the sensors, times the usual.
    severity : relative change of the acceleration by the effect [-]; or its strength, in its unit (hidden_tables.py).
    length : scale of the recordings' durations. among : effects that compete; all without any. minutes : after which
    the search ends with its best answer so far; none without.
    """
    commands = hidden.excitations(seed, length)
    made = truth(effect, severity, seed, commands) if strength is None else of_strength(effect, strength, seed)
    records = recordings(effect, seed, noise, made, commands)
    learn, hold = fitted_parts(records, "learn"), fitted_parts(records, "hold")
    model = replace(model_structure(load_table("bergamo")), candidates=candidates(among))
    with Progress("close_loop", shown=False) as silent, Ending(silent, minutes) as progress:
        result = close_loop(model, learn, hold, load_search(), progress, progress.deadline_passed)
    report = close_loop_json(result, names_of(learn), names_of(hold), "full")
    felt = {name: np.concatenate([r.motion[:, 1] for r in hold if r.name == name]) for name in names_of(hold)}
    floor = {name: noise * hidden.ACCELERATION_NOISE / float(np.std(values)) for name, values in felt.items()}
    return {**judged(effect, report), **errors(report, floor), **told(result, report, made, effect)}


def truth(effect: str, severity: float, seed: int, commands: dict[str, np.ndarray]) -> hidden.Truth:
    """The table of a row."""
    base = hidden.declared_truth(seed)
    return base if effect == NONE else hidden.with_effect(base, effect, severity, commands, seed)


def of_strength(effect: str, strength: float, seed: int) -> hidden.Truth:
    """The table with an effect of a given strength; its companions are drawn as for a given severity."""
    return hidden.with_companions(hidden.declared_truth(seed), effect, seed)[0]._replace(**{effect: strength})


def recordings(
    effect: str, seed: int, noise: float, table: hidden.Truth, commands: dict[str, np.ndarray]
) -> dict[str, Record]:
    """The four recordings of a row by name."""
    rng = np.random.default_rng([seed, round(10 * noise), *effect.encode()])
    made = {name: hidden.record(table, u, noise, rng) for name, u in commands.items()}
    return {n: Record(n, hidden.SAMPLE, m["command"], m["position"], m["acceleration"]) for n, m in made.items()}


def fitted_parts(records: dict[str, Record], kind: str) -> list[Record]:
    """The recordings whose names begin with "learn" or "hold", without what lies at the end stops."""
    stroke = load_table("bergamo").value("body.stroke")
    return within_stroke([r for n, r in records.items() if n.startswith(kind)], stroke)[0]


def candidates(among: Sequence[str]) -> tuple[CandidateEffect, ...]:
    """The effects that compete."""
    return tuple(c for c in effect_candidates() if not among or c.effect in among)


def kind_of(effect: str) -> str:
    """Whether an effect is listed, unlisted or none."""
    if effect == NONE:
        return NONE
    return "listed" if hidden.HIDDEN[effect].listed else "unlisted"


def left_open(group: Sequence[str]) -> Sequence[str]:
    """The effects of which an answer means one: of more than LARGEST_GROUP the first alone counts."""
    return group if len(group) <= LARGEST_GROUP else group[:1]


def verdicts_of(closed: LoopClosure, effects: Sequence[str]) -> list[dict[str, Any]]:
    """The odds of each effect with a verdict, and whether it, or one that could stand in its place, is there.

    effects : that are hidden. An effect of none of the listed ones is "unlisted".
    """
    there = {effect if hidden.HIDDEN[effect].listed else "unlisted" for effect in effects if effect != NONE}
    return [
        {"odds": v.odds, "state": v.state, "right": bool(there & set(left_open([v.effect, *v.alternatives])))}
        for v in (*closed.verdicts, *closed.candidates)
    ]


def judged(effect: str, report: Mapping[str, Any]) -> dict[str, Any]:
    """Whether the answer is right: None where a question does not arise."""
    steps, rest, kind = report["steps"], report["remaining"], kind_of(effect)
    named = [step["effect"] for step in steps]
    answer = named[0] if named else "unlisted" if rest["place"] else NONE
    group = [answer, *(steps[0]["alternatives"] if steps else [])]
    hit = answer == "unlisted" if kind == "unlisted" else effect in left_open(group)
    place = steps[0]["place"] if steps else rest["place"]
    confident = "unlisted" not in named and answer != NONE and not rest["above_noise"]
    return {
        "kind": kind,
        "named": named,
        "answer": answer,
        "group": group,
        "hit": None if kind == NONE else hit,
        "alone": None if kind == NONE else hit and len(group) == 1,
        "whole_list": None if kind == NONE else hit and len(named) == 1,
        "place_right": None if kind == NONE else place == hidden.HIDDEN[effect].place,
        "false_alarm": bool(named) if kind == NONE else None,
        "confident_mistake": confident if kind == "unlisted" else None,
        "state": steps[0]["state"] if steps and "state" in steps[0] else None,
    }


def errors(report: Mapping[str, Any], floor: Mapping[str, float]) -> dict[str, Any]:
    """Held-out acceleration errors before and after, and the latter over the noise [-], means over the recordings."""
    before, after = ([report[m]["error"]["hold"][n]["acceleration"] for n in floor] for m in ("baseline", "final"))
    over = [error / floor[name] for name, error in zip(floor, after, strict=True)]
    return {"before": float(np.mean(before)), "after": float(np.mean(after)), "over_noise": float(np.mean(over))}


def told(result: LoopClosure, report: Mapping[str, Any], made: hidden.Truth, effect: str) -> dict[str, Any]:
    """What else is worth keeping: the true strength, what was found of it, what was close."""
    steps = report["steps"]
    return {
        "strength": None if effect == NONE else float(getattr(made, effect)),
        "parameters": [step["parameters"] for step in steps],
        "ranking": [[r["effect"] for r in step["evidence"].get("ranking", [])[:6]] for step in steps],
        "removed": list(result.search.removed),
        "above_noise": bool(report["remaining"]["above_noise"]),
        "remaining_place": report["remaining"]["place"],
        "verdicts": verdicts_of(result, [effect]),
    }
