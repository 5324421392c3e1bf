"""`sensitivity`: what θ_5, θ_6 and θ_7 of (6.15) do to the table; figures 6.19–6.24 of the thesis drawn again.

The experiment of 6.3.4 does so on the constant modulus of table 6.8 and on table 6.9.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.loops import strict
from shake_ros.api.progress import Progress
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import initial_state, run_batch
from shake_ros.data.result_folder import refuse_existing, write_json, writing
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.settings import find, load_table, read_yaml
from shake_ros.thesis.reproduce import Claim, ExperimentReport, Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure


KEYS = (
    "table", "flow_coefficient", "amplitude", "frequency", "periods", "sample_time", "base",
    "theta_5", "theta_6", "theta_7",
)  # fmt: skip
NUMBERS = {"theta_5": ("6_19", "6_20"), "theta_6": ("6_21", "6_22"), "theta_7": ("6_23", "6_24")}
CHANNELS = ("position", "velocity", "acceleration")
STEADY_PERIODS = 6


SYMBOLS = {"theta_5": ("θ₅", "Pa/m³"), "theta_6": ("θ₆", "m³/(s·Pa)"), "theta_7": ("θ₇", "")}
ROWS = (("position [m]", 0), ("velocity [m/s]", 1), ("acceleration [m/s²]", 2))
SHOWN_PERIODS = 3
HIGHEST_HARMONIC = 15
LOWEST_SHOWN = 1e-2  # [m/s²]


def value_label(study: ParameterStudy, value: float) -> str:
    """Legend of one run."""
    symbol, unit = SYMBOLS[study.name]
    return f"{symbol} = {value:g} {unit}".rstrip()


Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ParameterStudy:
    """Simulations with one parameter changed.

    Attributes
    ----------
    name : of the parameter.
    values : shape (m,) in the unit of the thesis's θ.
    sample_time : [s].
    commands : shape (n,) [-].
    motion : shape (m, n, 3): position [m], velocity [m/s], acceleration [m/s²].
    """

    name: str
    values: Floats
    sample_time: float
    commands: Floats
    motion: Floats

    def spectrum(self, samples: int) -> tuple[Floats, Floats]:
        """Frequencies [Hz], shape (k,), and amplitudes [m/s²], shape (m, k), of the last `samples` of acceleration."""
        last = self.motion[:, -samples:, 2]
        amplitude = 2.0 / samples * np.abs(np.fft.rfft(last, axis=1))
        return np.asarray(np.fft.rfftfreq(samples, self.sample_time), dtype=float), np.asarray(amplitude, dtype=float)

    def spread(self, samples: int) -> Floats:
        """How far the runs lie apart in position, velocity and acceleration, relative to their size, shape (3,) [-].

        The root mean square over the last `samples` of the difference between the runs with the least and the greatest
        value, over that of their mean; the drift of an open-loop position is left out.
        """
        last = self.motion[:, -samples:, :] - self.motion[:, -samples:, :].mean(axis=1, keepdims=True)
        low, high = last[int(np.argmin(self.values))], last[int(np.argmax(self.values))]
        return np.asarray(np.std(high - low, axis=0) / np.std(0.5 * (high + low), axis=0))


def study_of(
    table: TableParameters,
    name: str,
    values: Floats,
    settings: list[dict[str, float]],
    commands: Floats,
    sample_time: float,
) -> ParameterStudy:
    """Simulate the table with each of `settings` (dotted names to values), side by side.

    Parameters
    ----------
    name, values : the parameter that is varied and its values.
    commands : shape (n,) [-].
    sample_time : [s].
    """
    vectors = np.array([table.with_values(changes).vector() for changes in settings])
    starts = np.array([initial_state(vector) for vector in vectors])
    motion = run_batch(vectors, starts, commands, sample_time, columns=(0, 1, 2))
    return ParameterStudy(name, np.asarray(values, dtype=float), sample_time, commands, motion)


@dataclass(frozen=True, repr=False)
class Sensitivity:
    """Simulations with one parameter changed at a time, by parameter.

    Attributes
    ----------
    studies : simulations of each parameter.
    frequency : of the command [Hz].
    samples : of the steady part.
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
        from shake_ros.thesis.figures_table import motion_figure, spectrum_figure

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
            write_json(folder / "sensitivity.json", self.summary())

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
    study : config/sensitivity/NAME.yaml or a file.
    table : another than the study's, by name, file or object.

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
        studies[name] = study_of(table, name, np.array(settings[name], dtype=float), changes, commands, dt)
    return Sensitivity(studies, frequency, round(STEADY_PERIODS / frequency / dt))


STUDIES = {"thesis": "table 6.8", "table_6_9": "table 6.9"}
NAMES = {"theta_5": "θ_5", "theta_6": "θ_6", "theta_7": "θ_7"}
BEYOND = (3, 5, 7, 9, 11)  # orders among which the dominant harmonic is sought


def dominant(study: Sensitivity, name: str) -> list[float]:
    """Frequency of the largest harmonic beyond the fundamental for each value [Hz]."""
    frequencies, amplitudes = study.studies[name].spectrum(study.samples)
    places = [int(np.argmin(np.abs(frequencies - k * study.frequency))) for k in BEYOND]
    return [BEYOND[int(i)] * study.frequency for i in np.argmax(amplitudes[:, places], axis=1)]


def size(study: Sensitivity, name: str) -> list[float]:
    """Root mean square of the velocity for each value over that of the first [-]."""
    found = np.std(study.studies[name].motion[:, -study.samples :, 1], axis=1)
    return [float(v) for v in found / found[0]]


def charts(title: str, study: Sensitivity, name: str) -> list[Chart]:
    """The two figures of a parameter."""
    of, (motion, spectrum) = study.studies[name], NUMBERS[name]
    shown = {motion: "motion for values of", spectrum: "harmonics of the acceleration for values of"}
    words = {n: f"As figure {n.replace('_', '.')}: {what} {NAMES[name]}, {title}" for n, what in shown.items()}
    return [
        study_motion(f"figure_{motion}", of, study.frequency, words[motion]),
        study_spectrum(f"figure_{spectrum}", of, study.frequency, study.samples, words[spectrum]),
    ]


def spreads(study: Sensitivity, name: str) -> list[str]:
    """Spread of position, velocity and acceleration."""
    return [f"{100.0 * v:.1f} %" for v in study.spread(name).values()]


def run(progress: Progress) -> ExperimentReport:
    """The study on both tables."""
    found = {}
    for i, (study, title) in enumerate(STUDIES.items()):
        progress(f"sensitivity, {title}", i / len(STUDIES))
        found[title] = sensitivity(study)
    claims = [claim for title, study in found.items() for claim in _claims(title, study)]
    rows = [
        [title, NAMES[name], *spreads(study, name), ", ".join(f"{f:g}" for f in dominant(study, name))]
        for title, study in found.items()
        for name in NAMES
    ]
    head = ("plant", "parameter", "position", "velocity", "acceleration", "dominant harmonic [Hz], by value")
    drawn = [chart for title, study in found.items() for name in NAMES for chart in charts(title, study, name)]
    return ExperimentReport(
        title="Sensitivity to θ_5, θ_6 and θ_7",
        lead="u = 0.5 sin(2π·3t), one parameter at a time; thesis 6.3.4, figures 6.19 to 6.24.",
        claims=claims,
        tables=[
            Rows("Spread of the motion between the least and the greatest value, relative to its size", head, rows)
        ],
        charts=drawn,
        remarks=(
            "θ_7 multiplies the flow coefficient of table 6.3, which lacks a √2. The text prints the values of θ_5; "
            "for θ_6 the three columns of table 6.8 are used, for θ_7 values around them. 200 kg of specimen are "
            "assumed.",
            "On table 6.8 the third and fifth harmonic lie below the oil column and hardly see its stiffness, whereas "
            "leakage of 4.3 times the size takes flow from the fundamental; so θ_6 does more than θ_5. With the soft "
            "zone of table 6.9 the oil column lies among the harmonics, and the thesis's order appears, although θ_6 "
            "still matters.",
        ),
    )


def _claims(title: str, study: Sensitivity) -> list[Claim]:
    felt = {name: study.spread(name)["acceleration"] for name in NAMES}
    moved = {name: study.spread(name)["velocity"] for name in NAMES}
    shown = ", ".join(f"{NAMES[n]} {100.0 * felt[n]:.0f} %" for n in NAMES)
    harmonics, sizes = dominant(study, "theta_5"), size(study, "theta_7")
    return [
        Claim(
            "6.3.4", f"θ_5 changes the acceleration more than θ_6 ({title})", "text only", shown,
            felt["theta_5"] > felt["theta_6"],
        ),
        Claim(
            "6.3.4", f"θ_5 moves the dominant harmonic ({title})", "text only",
            ", ".join(f"{f:g}" for f in harmonics) + " Hz", len(set(harmonics)) > 1,
        ),
        Claim(
            "6.3.4", f"θ_7 sets the amplitude, and more of it gives more ({title})", "text only",
            "×".join(("", *(f"{s:.2f} " for s in sizes))).strip(),
            moved["theta_7"] == max(moved.values()) and sizes == sorted(sizes),
        ),
    ]  # fmt: skip


def study_motion(name: str, study: ParameterStudy, frequency: float, caption: str) -> Chart:
    """Figures 6.19, 6.21, 6.23: position, velocity and acceleration over the last periods."""
    shown = round(SHOWN_PERIODS / frequency / study.sample_time)
    time = np.arange(len(study.commands), dtype=np.float64)[-shown:] * study.sample_time
    panels = []
    for title, column in ROWS:
        runs = study.motion[:, -shown:, column]
        runs = runs - runs.mean(axis=1, keepdims=True) if column == 0 else runs
        series = [ChartSeries(value_label(study, float(v)), runs[i], f"c{i}") for i, v in enumerate(study.values)]
        panels.append(Panel(title, time, tuple(series)))
    return Chart(name, "time [s]", tuple(panels), caption)


def study_spectrum(name: str, study: ParameterStudy, frequency: float, samples: int, caption: str) -> Chart:
    """Figures 6.20, 6.22, 6.24: amplitudes of the acceleration's harmonics."""
    found, amplitudes = study.spectrum(samples)
    harmonics = frequency * np.arange(1, HIGHEST_HARMONIC + 1)
    places = [int(np.argmin(np.abs(found - f))) for f in harmonics]
    series = [
        ChartSeries(value_label(study, float(v)), amplitudes[i, places], f"c{i}", kind="marks")
        for i, v in enumerate(study.values)
    ]
    panel = Panel("acceleration [m/s²]", harmonics, tuple(series), log=True)
    return Chart(name, "frequency [Hz]", (panel,), caption)
