"""Which effect does close_loop name when the truth is known?

    python -m benchmarks.discovery.confusion [--quick] [--cases …]

Tables with one undeclared effect each, made by hidden_tables.py, which shares nothing with the package:
every listed effect, four that are on no list, and nothing at all, at severities of about 3, 10 and 30 % of the
acceleration, over seeds and noise levels. Prints the confusion matrix, hit rates, rate of right places, false alarms,
errors before and after against the noise floor, and times. Every finished case is saved at once in the results file,
and a case that is in it is not run again; --report only prints what is there.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ROOT
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.core.discovery.candidates import CandidateEffect
from shake_ros.core.discovery.close_loop import close_loop
from shake_ros.core.identification.recordings import Record
from shake_ros.data.results import close_loop_json
from shake_ros.declared import effect_candidates, model_structure
from shake_ros.settings import load_search, load_table

SEVERITIES = (0.1, 0.3, 0.03)
NONE = "none"
QUICK = ("spool_deadband", "accelerometer_lag", NONE)  # quick: these alone compete and are hidden
QUICK_POOL = ("spool_deadband", "accelerometer_lag", "friction_asymmetry", "command_delay")


@dataclass(frozen=True)
class Case:
    """One table with its recordings. length : scale of the recordings' durations."""

    effect: str
    severity: float
    seed: int
    noise: float
    length: float = 1.0

    @property
    def key(self) -> str:
        """Name in the results file."""
        return f"{self.effect} {self.severity:g} seed {self.seed} noise {self.noise:g} length {self.length:g}"


def truth(case: Case, commands: dict[str, np.ndarray]) -> hidden.Truth:
    """The table of a case."""
    base = hidden.declared_truth(case.seed)
    return base if case.effect == NONE else hidden.with_effect(base, case.effect, case.severity, commands, case.seed)


def recordings(case: Case, table: hidden.Truth, commands: dict[str, np.ndarray]) -> dict[str, Record]:
    """The four recordings of a case by name."""
    rng = np.random.default_rng([case.seed, round(10 * case.noise), *case.effect.encode()])
    made = {name: hidden.record(table, u, case.noise, rng) for name, u in commands.items()}
    return {n: Record(n, hidden.SAMPLE, m["command"], m["position"], m["acceleration"]) for n, m in made.items()}


def run(case: Case, pool: tuple[CandidateEffect, ...]) -> dict[str, Any]:
    """Close the loop on one case; what it named and the errors, ready for JSON."""
    commands = hidden.excitations(case.seed, case.length)
    made = truth(case, commands)
    records = recordings(case, made, commands)
    learn = [r for n, r in records.items() if n.startswith("learn")]
    hold = [r for n, r in records.items() if n.startswith("hold")]
    start = time.perf_counter()
    model = replace(model_structure(load_table("bergamo")), candidates=pool)
    result = close_loop(model, learn, hold, load_search(), lambda text, part: None)
    seconds = time.perf_counter() - start
    report = close_loop_json(result, [r.name for r in learn], [r.name for r in hold], "full")
    floor = {r.name: case.noise * hidden.ACCELERATION_NOISE / float(np.std(r.acceleration)) for r in hold}
    strength = {} if case.effect == NONE else {"strength": float(getattr(made, case.effect))}
    return {
        "case": {**vars(case), **strength},
        "named": [s["effect"] for s in report["steps"]],
        "alternatives": [s["alternatives"] for s in report["steps"]],
        "places": [s["place"] for s in report["steps"]],
        "parameters": [s["parameters"] for s in report["steps"]],
        "rankings": [s["evidence"].get("ranking", [])[:6] for s in report["steps"]],
        "rejected": [
            [a.candidate.effect, a.result.estimation_cost, a.result.validation_cost] for a in result.search.rejected[:6]
        ],
        "removed": list(result.search.removed),
        "remaining": report["remaining"],
        "declared": {p.name: p.value for p in result.baseline.parameters},
        "before": {n: e["acceleration"] for n, e in report["baseline"]["error"]["hold"].items()},
        "after": {n: e["acceleration"] for n, e in report["final"]["error"]["hold"].items()},
        "floor": floor,
        "ratio": result.remaining.ratio,
        "seconds": seconds,
    }


def candidates(quick: bool) -> tuple[CandidateEffect, ...]:
    """The effects that compete."""
    pool = effect_candidates()
    return tuple(c for c in pool if c.effect in QUICK_POOL) if quick else pool


def worker(case: Case, quick: bool) -> tuple[str, dict[str, Any]]:
    """One case in a process of its own; a failure is a result too."""
    try:
        return case.key, run(case, candidates(quick))
    except Exception as error:  # a row that says so is better than a lost table of results
        return case.key, {"case": vars(case), "failed": f"{type(error).__name__}: {error}"}


def chosen_cases(given: argparse.Namespace) -> list[Case]:
    """Cases in the order in which they are most wanted: one seed of everything first."""
    if given.quick:
        return [Case(effect, 0.0 if effect == NONE else 0.1, 1, 1.0, 0.5) for effect in QUICK]
    effects = given.cases or [*hidden.HIDDEN, NONE]
    cases = []
    for seed in given.seeds:
        for noise in given.noise:
            for severity in given.severities:
                for effect in effects:
                    if effect == NONE and severity != given.severities[0]:
                        continue
                    cases.append(Case(effect, 0.0 if effect == NONE else severity, seed, noise, given.length))
    return cases


def place_of(effect: str) -> str | None:
    """Place of a hidden effect."""
    return hidden.HIDDEN[effect].place if effect in hidden.HIDDEN else None


def answer(row: dict[str, Any]) -> str:
    """First effect named; 'unlisted' where none but a place where something remains; else 'none'."""
    if row["named"]:
        return str(row["named"][0])
    return "unlisted" if row["remaining"]["place"] else NONE


def group(row: dict[str, Any]) -> list[str]:
    """First effect with its alternatives."""
    return [answer(row), *(row["alternatives"][0] if row["alternatives"] else [])]


def is_hit(row: dict[str, Any]) -> bool:
    """Whether the first effect named is the truth, or lists it in a group of at most three."""
    effect, named = row["case"]["effect"], group(row)
    if effect in hidden.HIDDEN and not hidden.HIDDEN[effect].listed:
        return named[0] == "unlisted"
    return effect == named[0] or (effect in named and len(named) <= 3)


def is_place(row: dict[str, Any]) -> bool:
    """Whether the place of the first answer is right."""
    place = row["places"][0] if row["places"] else row["remaining"]["place"]
    return bool(place == place_of(row["case"]["effect"]))


def is_confident_mistake(row: dict[str, Any]) -> bool:
    """An unlisted truth named as a listed effect that leaves nothing above the noise."""
    return "unlisted" not in row["named"] and answer(row) != NONE and not row["remaining"]["above_noise"]


def rate(rows: Sequence[dict[str, Any]], wanted: Any) -> str:
    """Share of rows in per cent with their number."""
    return f"{100.0 * sum(map(wanted, rows)) / len(rows):5.1f} % of {len(rows)}" if rows else "    no case"


def summary(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Rates by severity, then false alarms, unlisted effects, errors and times."""
    good = [r for r in rows if "failed" not in r]
    listed = [r for r in good if r["case"]["effect"] in hidden.HIDDEN and hidden.HIDDEN[r["case"]["effect"]].listed]
    for severity in sorted({r["case"]["severity"] for r in listed}):
        some = [r for r in listed if r["case"]["severity"] == severity]
        alone = [r for r in some if answer(r) == r["case"]["effect"] and len(group(r)) == 1]
        yield f"severity {100 * severity:4.0f} %: first effect {rate(some, is_hit)}"
        shared = rate(some, lambda r: is_hit(r) and len(group(r)) > 1)
        yield f"    alone and right {100.0 * len(alone) / len(some):5.1f} %; in a group {shared}"
        yield f"    the list exactly  {rate(some, lambda r: is_hit(r) and len(r['named']) == 1)}"
        yield f"    place           {rate(some, is_place)}"
    nothing = [r for r in good if r["case"]["effect"] == NONE]
    yield f"no effect: false alarms {rate(nothing, lambda r: bool(r['named']))}"
    unlisted = [r for r in good if r["case"]["effect"] in hidden.HIDDEN and r not in listed]
    yield f"unlisted: a listed one with confidence {rate(unlisted, is_confident_mistake)}"
    yield f"    place {rate(unlisted, is_place)}"
    for text, some in (("listed", listed), ("unlisted", unlisted), ("no effect", nothing)):
        if some:
            before = np.median([np.mean(list(r["before"].values())) for r in some])
            after = np.median([np.mean(list(r["after"].values())) for r in some])
            floor = np.median([np.mean([r["after"][n] / r["floor"][n] for n in r["after"]]) for r in some])
            yield f"held-out error, median, {text}: {before:.4f} before, {after:.4f} after, {floor:.2f} × noise floor"
    times = [r["seconds"] for r in good]
    if times:
        yield f"time per case: median {np.median(times):.0f} s, longest {max(times):.0f} s, {len(times)} cases"
    for row in rows:
        if "failed" in row:
            yield f"failed: {row['case']['effect']}: {row['failed']}"


def matrix(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """The confusion matrix as a list: truth, what was named how often (with alternatives), × marks what is wrong."""
    table: dict[tuple[str, float], Counter[str]] = defaultdict(Counter)
    for row in rows:
        if "failed" not in row:
            others = group(row)[1:]
            text = answer(row) + (f" (or {', '.join(others)})" if others else "")
            text += "" if is_hit(row) else " ×"
            text += "".join(f", then {more}" for more in row["named"][1:])
            table[row["case"]["effect"], row["case"]["severity"]][text] += 1
    for (effect, severity), named in sorted(table.items()):
        yield f"{effect:32} {100 * severity:3.0f} %  " + "; ".join(f"{n} × {t}" for t, n in named.most_common())


def load(path: Path) -> dict[str, Any]:
    """Results that are there already."""
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def save(path: Path, results: dict[str, Any]) -> None:
    """Write the results whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps(results, indent=1), encoding="utf-8")
    os.replace(new, path)


def arguments(given: Sequence[str]) -> argparse.Namespace:
    """The command line."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--cases", nargs="+", choices=[*hidden.HIDDEN, NONE], help="effects to hide (default: all)")
    command.add_argument("--severities", nargs="+", type=float, default=list(SEVERITIES))
    command.add_argument("--seeds", nargs="+", type=int, default=[1])
    command.add_argument("--noise", nargs="+", type=float, default=[1.0, 3.0], help="multiples of the usual noise")
    command.add_argument("--length", type=float, default=1.0, help="scale of the recordings' durations")
    command.add_argument("--jobs", type=int, default=1)
    command.add_argument("--quick", action="store_true", help="three cases, four candidates, short recordings")
    command.add_argument("--report", action="store_true", help="print the saved results and stop")
    command.add_argument("--results", type=Path, default=ROOT / "out" / "confusion.json")
    return command.parse_args(list(given))


def main(given: Sequence[str] = tuple(sys.argv[1:])) -> dict[str, Any]:
    """Run what is missing, print, return the results by case."""
    options = arguments(given)
    results = {} if options.quick else load(options.results)
    wanted = [] if options.report else [c for c in chosen_cases(options) if c.key not in results]
    with ProcessPoolExecutor(options.jobs) if options.jobs > 1 else _Here() as pool:
        for key, row in pool.map(worker, wanted, [options.quick] * len(wanted)):
            results[key] = row
            print(f"{key}: {row.get('failed') or ', '.join(group(row))} [{row.get('seconds', 0.0):.0f} s]", flush=True)
            if not options.quick:
                save(options.results, results)
    print("\n".join(["", *matrix(list(results.values())), "", *summary(list(results.values()))]))
    return results


class _Here:
    """A pool without processes."""

    map = staticmethod(map)

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing to close."""


if __name__ == "__main__":
    main()
