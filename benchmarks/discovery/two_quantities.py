"""Are functions of two quantities found where one does not suffice? python -m benchmarks.discovery.two_quantities.

Tables of hidden_tables.py, a simulator of its own, with a disturbance that depends on two quantities at once; and two
that depend on one, where nothing of two may be offered. The whole search runs twice, with functions of one quantity
alone and with a second one: what is named, the held-out error of the acceleration over that of the sensor noise, how
long it takes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from benchmarks.discovery import confusion
from benchmarks.discovery import hidden_tables as hidden
from shake_ros.api.fitted import names_of
from shake_ros.declared import model_structure
from shake_ros.fit.records import Record
from shake_ros.repair.close_loop import close_loop
from shake_ros.report.report_json import close_loop_json
from shake_ros.report.text import function_line
from shake_ros.settings import load_search, load_table

HIDDEN: dict[str, dict[str, float]] = {
    "drag that depends on the place": {"place_drag": 5e7},
    "leakage where the bore is worn": {"worn_bore": 1.2e-10},
    "push at one place that fades with time": {"force_bump": 6000.0, "bump_fading": 2.0},
    "flow gain of opening and load pressure": {"loaded_valve": 1.0},
    "friction at one place": {"friction_bump": 1500.0},
    "push at one place": {"force_bump": 1500.0},
}
LEARN = ("learn_ladder", "hold_pulses")  # of hidden_tables.excitations: these visit most of both quantities
HOLD = ("learn_multisine", "hold_multisine")
NOISE = 1.0  # of the sensors, times the usual


def recordings(case: str, seed: int, length: float) -> dict[str, Record]:
    """The four recordings of a table, to learn from and held out by their names."""
    truth = hidden.declared_truth(seed)._replace(**HIDDEN[case])
    commands = hidden.excitations(seed, length)
    made = confusion.recordings(case, seed, NOISE, truth, commands)
    roles = [(f"learn_{i}", name) for i, name in enumerate(LEARN)] + [(f"hold_{i}", n) for i, n in enumerate(HOLD)]
    return {role: replace(made[name], name=role) for role, name in roles}


def searched(records: dict[str, Record], seconds: int | None) -> dict[str, Any]:
    """The answer of the search. seconds : second quantities that are refitted; as configured without."""
    learn, hold = (confusion.fitted_parts(records, kind) for kind in ("learn", "hold"))
    settings = load_search() if seconds is None else replace(load_search(), most_refitted=seconds)
    begin = time.process_time()
    result = close_loop(model_structure(load_table("bergamo")), learn, hold, settings, lambda *_: None)
    taken = time.process_time() - begin
    report = close_loop_json(result, names_of(learn), names_of(hold), "full")
    over = []
    for name in names_of(hold):
        felt = [r for r in hold if r.name == name]
        square = sum(float(r.motion[:, 1] @ r.motion[:, 1]) for r in felt)
        rms = (square / sum(len(r.motion) for r in felt)) ** 0.5
        noise = NOISE * hidden.ACCELERATION_NOISE
        over.append([report[m]["error"]["hold"][name]["acceleration"] * rms / noise for m in ("baseline", "final")])
    before, after = (sum(values) / len(values) for values in zip(*over, strict=True))
    named = [f"{s['effect']} ({s['place']}: {', '.join(s['depends_on'])})" for s in report["steps"]]
    form = function_line(result.function) if result.function else ""
    return {"named": " + ".join(named) or "nothing", "before": before, "after": after, "seconds": taken, "form": form}


def main(given: Sequence[str] | None = None) -> None:
    """Print a row for each table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--length", type=float, default=1.0, help="scale of the recordings' durations")
    parser.add_argument("--cases", nargs="+", default=list(HIDDEN), choices=list(HIDDEN))
    options = parser.parse_args(given)
    print("held-out error of the acceleration over the sensor noise: declared → with one quantity → with two")
    for case in options.cases:
        for seed in options.seeds:
            records = recordings(case, seed, options.length)
            one, two = searched(records, 0), searched(records, None)
            print(f"\n{case}, seed {seed}: {one['before']:.2f} → {one['after']:.2f} → {two['after']:.2f}")
            print(f"    one: {one['named']}; {one['seconds']:.0f} s")
            print(f"    two: {two['named']}; {two['seconds']:.0f} s", flush=True)
            if two["form"]:
                print(f"    {two['form']}", flush=True)


if __name__ == "__main__":
    main()
