"""`sensitivity`: what θ_5, θ_6 and θ_7 of (6.15) do to the table, figures 6.19–6.24 of the thesis drawn again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.api.loops import strict
from shake_ros.core.analysis import parameter_study
from shake_ros.core.analysis.parameter_study import ParameterStudy
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.data.results import refuse_existing, writing
from shake_ros.settings import find, load_table, read_yaml

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KEYS = (
    "table", "flow_coefficient", "amplitude", "frequency", "periods", "sample_time", "base",
    "theta_5", "theta_6", "theta_7",
)  # fmt: skip
NUMBERS = {"theta_5": ("6_19", "6_20"), "theta_6": ("6_21", "6_22"), "theta_7": ("6_23", "6_24")}
CHANNELS = ("position", "velocity", "acceleration")
STEADY_PERIODS = 6


@dataclass(frozen=True, repr=False)
class Sensitivity:
    """Simulations with one parameter changed at a time, by parameter.

    Attributes
    ----------
    studies : simulations of each parameter. frequency : of the command [Hz]. samples : of the steady part.
    """

    studies: Mapping[str, ParameterStudy]
    frequency: float
    samples: int

    def spread(self, name: str) -> dict[str, float]:
        """How far the motions of a parameter's least and greatest value lie apart, relative to their size [-]."""
        return dict(zip(CHANNELS, self.studies[name].spread(self.samples).tolist(), strict=True))

    def summary(self) -> dict[str, Any]:
        """Odd harmonics of the acceleration [m/s²] and spread of the motion [-], per parameter."""
        content: dict[str, Any] = {}
        for name, result in self.studies.items():
            frequencies, amplitudes = result.spectrum(self.samples)
            places = [int(np.argmin(np.abs(frequencies - k * self.frequency))) for k in range(1, 16, 2)]
            harmonics = amplitudes[:, places].tolist()
            content[name] = {"values": result.values.tolist(), "odd_harmonics": harmonics, "spread": self.spread(name)}
        return content

    def plot(self) -> dict[str, Figure]:
        """Figures 6.19 to 6.24 by number."""
        from shake_ros.report.figures_sensitivity import motion_figure, spectrum_figure

        found = {}
        for name, (motion, spectrum) in NUMBERS.items():
            found[motion] = motion_figure(self.studies[name], self.frequency)
            found[spectrum] = spectrum_figure(self.studies[name], self.frequency, self.samples)
        return found

    def report(self, out: str | Path, force: bool = False) -> None:
        """Write the figures and sensitivity.json into a folder."""
        folder = Path(out)
        check_free(folder, force)
        with writing():
            folder.mkdir(parents=True, exist_ok=True)
            for number, figure in self.plot().items():
                figure.savefig(folder / f"figure_{number}.png", dpi=130)
            text = json.dumps(self.summary(), indent=1) + "\n"
            (folder / "sensitivity.json").write_text(text, encoding="utf-8")

    def __repr__(self) -> str:
        lines = ["spread of the motion between the least and the greatest value, relative to its size"]
        for name in self.studies:
            spread = "  ".join(f"{key} {value:6.1%}" for key, value in self.spread(name).items())
            lines.append(f"  {name}: {spread}")
        return "\n".join(lines)


def check_free(folder: Path, force: bool) -> None:
    """Refuse existing files of a report before the work, not after it."""
    names = [f"figure_{number}.png" for pair in NUMBERS.values() for number in pair]
    refuse_existing(*(folder / name for name in (*names, "sensitivity.json")), force=force)


def values_of(table: TableParameters, flow_coefficient: float, thetas: Mapping[str, float]) -> dict[str, float]:
    """θ_5, θ_6, θ_7 of (6.15) as values of a table; θ_7 multiplies the printed flow coefficient [m³/(s·√Pa)]."""
    return {
        "bulk_modulus.modulus": thetas["theta_5"] * 0.5 * table.body.cylinder_volume,  # E = θ_5 V_t/2
        "leakage.internal": 0.0,
        "leakage.external": thetas["theta_6"],
        "valve.flow_coefficient": thetas["theta_7"] * flow_coefficient,
    }


def sensitivity(study: str = "thesis", table: str | TableParameters | None = None) -> Sensitivity:
    """Simulate the table under a sine with several values of θ_5, θ_6 and θ_7 of (6.15), one at a time.

    Parameters
    ----------
    study : config/sensitivity/NAME.yaml or a file. table : another than the study's, by name, file or object.

    Raises
    ------
    ShakeError
        An unknown study, or keys it should not have.

    Examples
    --------
    >>> import shake_ros as sr
    >>> print(sr.sensitivity())
    spread of the motion between the least and the greatest value, relative to its size
      theta_5: position   1.9%  velocity   2.0%  acceleration   4.8%
      theta_6: position  14.1%  velocity  14.1%  acceleration  15.5%
      theta_7: position  37.0%  velocity  37.1%  acceleration  37.4%
    """
    path = find("sensitivity", study)
    settings = strict(read_yaml(path), KEYS, str(path))
    if table is None or isinstance(table, str):
        table = load_table(table or settings["table"])
    dt, frequency = settings["sample_time"], settings["frequency"]
    length = round(settings["periods"] / frequency / dt)
    commands = settings["amplitude"] * np.sin(2.0 * np.pi * frequency * np.arange(length) * dt)
    studies = {}
    for name in NUMBERS:
        thetas = [settings["base"] | {name: value} for value in settings[name]]
        changes = [values_of(table, settings["flow_coefficient"], changed) for changed in thetas]
        studies[name] = parameter_study.study(table, name, np.array(settings[name], dtype=float), changes, commands, dt)
    return Sensitivity(studies, frequency, round(STEADY_PERIODS / frequency / dt))
