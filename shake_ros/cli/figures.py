"""figures: the thesis's figures drawn again from the equations in the package."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.figures import FIGURES, figures, known_figures
from shake_ros.data.results import refuse_existing, writing


def parser() -> argparse.ArgumentParser:
    """The command line."""
    listing = "\n".join(f"  {name:10} {drawing.line}" for name, drawing in FIGURES.items())
    p = argparse.ArgumentParser(
        prog="figures",
        description="Draw figures of the thesis again: their numbers, or 'all'.",
        epilog=f"figures:\n{listing}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("names", nargs="+", metavar="NAME", help="number of a figure, or all")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for figure_NAME.png")
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    given = parser().parse_args(list(arguments))
    targets = {name: given.out / f"figure_{name.replace('.', '_')}.png" for name in known_figures(given.names)}
    refuse_existing(*targets.values(), force=given.force)
    for name, target in targets.items():
        with writing():
            given.out.mkdir(parents=True, exist_ok=True)
            figures(name)[name].savefig(target, dpi=130)
        print(f"written: {target}")
    return 0
