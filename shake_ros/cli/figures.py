"""figures: the thesis's figures drawn again from the equations in the package."""

from __future__ import annotations

import argparse
import importlib
import sys
from dataclasses import dataclass
from pathlib import Path

from shake_ros.core.effects import EFFECTS
from shake_ros.core.quantities import ShakeError, unknown_name


@dataclass(frozen=True)
class Entry:
    """A figure: the module and function that draw it, `module:function`, and what it shows in a line."""

    drawn_by: str
    line: str


FIGURES: dict[str, Entry] = {
    "2.4": Entry("shake_ros.report.figures_fluid:entrained_air", "bulk modulus with entrained air, four models"),
    "2.5": Entry("shake_ros.report.figures_fluid:empirical", "empirical formulas for the bulk modulus"),
    "3.6": Entry("shake_ros.report.figures_friction:curves", "steady friction of all laws against velocity"),
    "3.7": Entry("shake_ros.report.figures_friction:lag", "frictional lag"),
    "3.8": Entry("shake_ros.report.figures_friction:reversal", "hysteresis with velocity"),
    "3.9": Entry("shake_ros.report.figures_friction:presliding", "pre-sliding displacement"),
    "3.10": Entry("shake_ros.report.figures_friction:stick_slip", "stick-slip at 1 mm/s"),
    "break_away": Entry("shake_ros.report.figures_friction:break_away", "break-away force against force rate"),
    "6.10": Entry("shake_ros.report.figures_valve:steps", "steps of the detailed and the simplified valve"),
    "6.11": Entry("shake_ros.report.figures_valve:frequency_response", "frequency response of both valves"),
    **{
        name: Entry("shake_ros.report.figures_effects:effect_figure", f"what {name} does to a 2 Hz and a 5 Hz sine")
        for name in EFFECTS
        if "full" in EFFECTS[name].models and name != "unlisted"
    },
}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    listing = "\n".join(f"  {name:10} {entry.line}" for name, entry in FIGURES.items())
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


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        run(arguments)
    except ShakeError as error:
        print(f"figures: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"figures: {error.filename}: cannot be written ({error.strerror})", file=sys.stderr)
        return 2
    return 0


def run(arguments: argparse.Namespace) -> None:
    """Check every name and target, then draw."""
    names = list(FIGURES) if "all" in arguments.names else list(dict.fromkeys(arguments.names))
    for name in names:
        if name not in FIGURES:
            raise unknown_name("figure", name, [*FIGURES, "all"])
    targets = {name: arguments.out / f"figure_{name.replace('.', '_')}.png" for name in names}
    for target in targets.values():
        if target.exists() and not arguments.force:
            raise ShakeError(f"{target}: exists already; --force overwrites")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, target in targets.items():
        module, function = FIGURES[name].drawn_by.split(":")
        draw = getattr(importlib.import_module(module), function)
        (draw(name) if name in EFFECTS else draw()).savefig(target, dpi=130)
        print(f"written: {target}")
