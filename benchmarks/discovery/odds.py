"""How often is an effect there whose odds are so and so? python -m benchmarks.discovery.odds OUT…

OUT are folders of the campaigns confusion, several_effects and foreign. Each verdict counts, on what was named and on
what was not established: odds of 19 : 1 should be right 19 times in 20. The expected calibration error is the mean
distance of what was foreseen from what was right, of bins of the odds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.campaigns.campaign import CampaignFile

EDGES = (0.0, 1.0, 20.0, 1e3, 1e6, np.inf)  # of the odds


def table(odds: np.ndarray, right: np.ndarray) -> list[str]:
    """A line for each bin, and the expected calibration error.

    odds : shape (n,). right : whether the effect is there, shape (n,).
    """
    foreseen, lines, error = odds / (1.0 + odds), ["odds | verdicts | foreseen | right"], 0.0
    for low, high in zip(EDGES[:-1], EDGES[1:], strict=True):
        inside = (odds >= low) & (odds < high)
        if inside.any():
            expected, met = float(np.mean(foreseen[inside])), float(np.mean(right[inside]))
            error += float(np.mean(inside)) * abs(expected - met)
            lines.append(f"{low:g} … {high:g} | {inside.sum()} | {100.0 * expected:.1f} % | {100.0 * met:.1f} %")
    return [*lines, f"expected calibration error {error:.3f} of {len(odds)} verdicts"]


def main(given: Sequence[str] | None = None) -> None:
    """Print the table of all rows."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("out", nargs="+", type=Path, metavar="OUT")
    verdicts = list[dict[str, Any]]()
    for out in options.parse_args(given).out:
        with CampaignFile(out, write=False) as rows:
            verdicts += [v for row in rows if row.figures is not None for v in row.figures["verdicts"]]
    print("\n".join(table(np.array([v["odds"] for v in verdicts]), np.array([v["right"] for v in verdicts]))))


if __name__ == "__main__":
    main()
