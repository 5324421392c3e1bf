"""What does close_loop name on tables of which nothing is known, when the truth is?

    python -m benchmarks.discovery.foreign_study [--seeds FIRST LAST] [--minutes M] [--report]

Tables of foreign_tables.py, none to four effects hidden in each, three recordings to learn from and two held out, all
in volts and with offsets of their own; `close_loop` with the model `unknown`. Prints the share of hidden effects found,
wrong names per case, the held-out error over the noise, and false alarms, each with its number and 95 % interval.
Every finished case is saved at once; --minutes starts no further case after that time; --report only prints.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import shake_ros as sr
from benchmarks import ROOT
from benchmarks.discovery import foreign_tables as foreign
from benchmarks.discovery.confusion import load, save


def run(seed: int, seconds: float) -> dict[str, Any]:
    """One case: what was hidden and named, errors over the noise."""
    case = foreign.case_of(seed)
    runs, noise = {}, {}
    for name in foreign.RUNS:
        made = foreign.record(case, name, seconds)
        noise[name] = float(made.pop("noise"))
        runs[name] = sr.recording(name, **made)
    learn, hold = ([n for n in foreign.RUNS if n.startswith(role)] for role in ("learn", "hold"))
    start = time.perf_counter()
    found = sr.close_loop(sr.model("unknown"), [runs[n][0] for n in learn], [runs[n][0] for n in hold], progress=False)
    floor = {n: noise[n] / float(np.std(runs[n][0].acceleration)) for n in hold}
    over = {
        which: [m.validation[n]["acceleration"] / floor[n] for n in hold]
        for which, m in (("before", found.closed.baseline), ("after", found.closed.final))
    }
    return {
        "seed": seed,
        "hidden": list(case.effects),
        "named": list(found.effects.names),
        "alternatives": [list(e.alternatives) for e in found.effects],
        "over_noise": {which: float(np.mean(values)) for which, values in over.items()},
        "seconds": time.perf_counter() - start,
    }


def share(hits: int, of: int) -> str:
    """A share with its 95 % interval (Wilson).

    >>> share(9, 10)
    '90 % of 10 (60 … 98 %)'
    """
    if of == 0:
        return "no case"
    z, p = 1.96, hits / of
    centre, width = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    low, high = ((centre + sign * width) / (1 + z * z / of) for sign in (-1, 1))
    return f"{100 * p:.0f} % of {of} ({100 * low:.0f} … {100 * high:.0f} %)"


def summary(rows: Sequence[dict[str, Any]]) -> Iterable[str]:
    """Shares and medians over all cases."""
    good = [r for r in rows if "failed" not in r]
    hidden = [(e, r) for r in good for e in r["hidden"]]
    yield f"hidden effects named: {share(sum(e in r['named'] for e, r in hidden), len(hidden))}"
    wrong = [sum(name not in r["hidden"] for name in r["named"]) for r in good]
    if good:
        yield f"wrong names per case: {np.mean(wrong):.2f} over {len(good)} cases"
    nothing = [r for r in good if not r["hidden"]]
    yield f"something named where nothing is hidden: {share(sum(bool(r['named']) for r in nothing), len(nothing))}"
    for which in ("before", "after"):
        values = [r["over_noise"][which] for r in good]
        if values:
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
            quartiles = f"quartiles {low:.2f}, {high:.2f}"
            yield f"held-out acceleration error over noise, {which}: median {middle:.2f} ({quartiles})"
    yield from (f"failed: seed {r['seed']}: {r['failed']}" for r in rows if "failed" in r)


def main(given: Sequence[str] = tuple(sys.argv[1:])) -> dict[str, Any]:
    """Run what is missing, print, return the results by seed."""
    command = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    command.add_argument("--seeds", nargs=2, type=int, default=[1, 40], metavar=("FIRST", "LAST"))
    command.add_argument("--minutes", type=float, default=math.inf, help="start no further case after so long")
    command.add_argument("--seconds", type=float, default=32.0, help="length of each recording")
    command.add_argument("--report", action="store_true", help="print the saved results and stop")
    command.add_argument("--results", type=Path, default=ROOT / "out" / "foreign_study.json")
    options = command.parse_args(list(given))
    results, start = load(options.results), time.monotonic()
    for seed in () if options.report else range(options.seeds[0], options.seeds[1] + 1):
        if str(seed) in results or time.monotonic() - start > 60.0 * options.minutes:
            continue
        try:
            row = run(seed, options.seconds)
        except Exception as error:  # a row that says so is better than a lost table of results
            row = {"seed": seed, "failed": f"{type(error).__name__}: {error}"}
        results[str(seed)] = row
        save(options.results, results)
        print(row, flush=True)
    print("\n".join(summary(list(results.values()))))
    return results


if __name__ == "__main__":
    main()
