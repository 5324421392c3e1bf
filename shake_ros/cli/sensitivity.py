"""sensitivity: what θ_5, θ_6 and θ_7 of (6.15) do to the table, figures 6.19–6.24 of the thesis drawn again."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from shake_ros.core.analysis.parameter_study import ParameterStudy, study
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.quantities import ShakeError, unknown_name
from shake_ros.report.figures_sensitivity import motion_figure, spectrum_figure
from shake_ros.settings import find, load_table, read_yaml

KEYS = ("table", "amplitude", "frequency", "periods", "sample_time", "base", "theta_5", "theta_6", "theta_7")
NUMBERS = {"theta_5": ("6_19", "6_20"), "theta_6": ("6_21", "6_22"), "theta_7": ("6_23", "6_24")}
STEADY_PERIODS = 6


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(prog="sensitivity", description="Study single parameters of (6.15): figures 6.19–6.24.")
    p.add_argument("--study", default="thesis", metavar="NAME", help="config/sensitivity/NAME.yaml or a file")
    p.add_argument("--table", help="another table than the study's")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the figures and sensitivity.json")
    p.add_argument("--force", action="store_true", help="overwrite")
    return p


def values_of(table: TableParameters, thetas: dict[str, float]) -> dict[str, float]:
    """θ_5, θ_6, θ_7 of (6.15) as values of a table."""
    return {
        "bulk_modulus.modulus": thetas["theta_5"] * 0.5 * table.body.cylinder_volume,  # E = θ_5 V_t/2
        "leakage.internal": 0.0,
        "leakage.external": thetas["theta_6"],
        "valve.flow_coefficient": thetas["theta_7"] * table.value("valve.flow_coefficient"),
    }


def read_study(name: str) -> dict[str, Any]:
    """The content of a study's file; unknown and missing keys are errors."""
    path = find("sensitivity", name)
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise ShakeError(f"{path}: expected {', '.join(KEYS)}")
    for key in content:
        if key not in KEYS:
            raise unknown_name("key", key, KEYS, str(path))
    missing = [key for key in KEYS if key not in content]
    if missing:
        raise ShakeError(f"{path}: missing {', '.join(missing)}")
    return content


def studies(settings: dict[str, Any], table: TableParameters) -> dict[str, ParameterStudy]:
    """The simulations of each parameter."""
    dt, frequency = settings["sample_time"], settings["frequency"]
    length = round(settings["periods"] / frequency / dt)
    commands = settings["amplitude"] * np.sin(2.0 * np.pi * frequency * np.arange(length) * dt)
    result = {}
    for name in NUMBERS:
        changes = [values_of(table, settings["base"] | {name: value}) for value in settings[name]]
        result[name] = study(table, name, np.array(settings[name], dtype=float), changes, commands, dt)
    return result


def summary(results: dict[str, ParameterStudy], frequency: float, samples: int) -> dict[str, Any]:
    """Harmonic amplitudes of the acceleration and spread of the motion, per parameter."""
    content: dict[str, Any] = {}
    for name, result in results.items():
        frequencies, amplitudes = result.spectrum(samples)
        places = [int(np.argmin(np.abs(frequencies - k * frequency))) for k in range(1, 16, 2)]
        spread = result.spread(samples)
        content[name] = {
            "values": result.values.tolist(),
            "odd_harmonics": amplitudes[:, places].tolist(),
            "spread": dict(zip(("position", "velocity", "acceleration"), spread.tolist(), strict=True)),
        }
    return content


def run(arguments: argparse.Namespace) -> None:
    """Simulate, draw, write."""
    settings = read_study(arguments.study)
    targets = [arguments.out / f"figure_{number}.png" for pair in NUMBERS.values() for number in pair]
    for target in (*targets, arguments.out / "sensitivity.json"):
        if target.exists() and not arguments.force:
            raise ShakeError(f"{target}: exists already; --force overwrites")
    results = studies(settings, load_table(arguments.table or settings["table"]))
    frequency = settings["frequency"]
    samples = round(STEADY_PERIODS / frequency / settings["sample_time"])
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, (motion, spectrum) in NUMBERS.items():
        motion_figure(results[name], frequency).savefig(arguments.out / f"figure_{motion}.png", dpi=130)
        spectrum_figure(results[name], frequency, samples).savefig(arguments.out / f"figure_{spectrum}.png", dpi=130)
    content = summary(results, frequency, samples)
    (arguments.out / "sensitivity.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print("spread of the motion between the least and the greatest value, relative to its size")
    for name, part in content.items():
        spread = "  ".join(f"{key} {value:6.1%}" for key, value in part["spread"].items())
        print(f"  {name}: {spread}")
    print(f"written: {arguments.out}")


def main(argv: list[str]) -> int:
    """Run the command; 0 done, 2 bad arguments or input."""
    try:
        arguments = parser().parse_args(argv)
    except SystemExit as stop:
        return int(stop.code or 0)
    try:
        run(arguments)
    except ShakeError as error:
        print(f"sensitivity: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"sensitivity: {error.filename}: cannot be written ({error.strerror})", file=sys.stderr)
        return 2
    return 0
