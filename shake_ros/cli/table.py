"""`table`: a configuration from nameplates: cylinder, valve, supply, masses; says what it assumed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from shake_ros.api.table import table

OPTIONS = (  # option, factor to SI, help
    ("bore", 1e-3, "bore of the cylinder [mm]"),
    ("rod", 1e-3, "diameter of the rod, the same on both sides unless --single-rod [mm]"),
    ("stroke", 1e-3, "full stroke [mm]"),
    ("rated-flow", 1.0 / 60000.0, "rated flow of the valve [l/min]"),
    ("rated-drop", 1e5, "pressure drop of the rated flow, both edges together [bar] (default: 70)"),
    ("supply", 1e5, "supply pressure, absolute [bar]"),
    ("table-mass", 1.0, "table with rod and piston [kg]"),
    ("specimen-mass", 1.0, "specimen [kg] (default: 0)"),
    ("hose-volume", 1e-3, "oil in both lines between valve and cylinder [l] (default: 0)"),
    ("valve-frequency", 1.0, "frequency of the valve at -90 degrees of phase [Hz]"),
    ("valve-damping", 1.0, "damping ratio of the valve [-]"),
)


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns its exit code."""
    command = argparse.ArgumentParser(prog="table", description=__doc__)
    for name, _, text in OPTIONS:
        command.add_argument(f"--{name}", type=float, metavar="NUMBER", help=text)
    command.add_argument("--single-rod", action="store_true", help="the rod is on side B alone: unequal areas")
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="YAML file to write")
    command.add_argument("--force", action="store_true", help="replace an existing file")
    given = vars(command.parse_args(list(arguments)))
    values = {name.replace("-", "_"): factor for name, factor, _ in OPTIONS}
    numbers = {name: given[name] * factor for name, factor in values.items() if given[name] is not None}
    made = table(single_rod=given["single_rod"], **numbers)
    path = made.save(given["out"], given["force"])
    print("\n".join([*(f"assumed: {line}" for line in made.assumed), f"table: {path}"]))
    return 0
