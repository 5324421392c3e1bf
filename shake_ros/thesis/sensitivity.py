"""`sensitivity`: what θ_5, θ_6 and θ_7 of (6.15) do to the table; figures 6.19–6.24 of the thesis drawn again.

The experiment of 6.3.4 does so on the constant modulus of table 6.8 and on table 6.9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.loops import strict
from shake_ros.api.progress import Progress
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import initial_state, run_batch
from shake_ros.report.chart import Chart, ChartSeries, Panel, static_figure
from shake_ros.result_folder import refuse_existing, write_json, writing
from shake_ros.settings import find, load_table, read_yaml
from shake_ros.thesis.reproduce import Claim, ExperimentReport, Rows, sine

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KEYS = (
    "table", "flow_coefficient", "amplitude", "frequency", "periods", "sample_time", "base",
    "theta_5", "theta_6", "theta_7",
)  # fmt: skip
NUMBERS = {"theta_5": ("6_19", "6_20"), "theta_6": ("6_21", "6_22"), "theta_7": ("6_23", "6_24")}
NAMES = {"theta_5": "θ_5", "theta_6": "θ_6", "theta_7": "θ_7"}
SYMBOLS = {"theta_5": ("θ₅", "Pa/m³"), "theta_6": ("θ₆", "m³/(s·Pa)"), "theta_7": ("θ₇", "")}
CHANNELS = {"position": "m", "velocity": "m/s", "acceleration": "m/s²"}
STEADY_PERIODS, SHOWN_PERIODS = 6, 3
HIGHEST_HARMONIC = 15
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ParameterStudy:
    """Simulations under a sine with one parameter changed."""

    name: str  # of the parameter
    values: Floats  # shape (m,) in the unit of the thesis's θ
    frequency: float  # of the command [Hz]
    sample_time: float  # [s]
    motion: Floats  # shape (m, n, 3): position [m], velocity [m/s], acceleration [m/s²]

    def last(self, periods: int) -> Floats:
        """The end of the motion, shape (m, k, 3)."""
        return self.motion[:, -round(periods / self.frequency / self.sample_time) :]

    def harmonics(self, orders: Sequence[int]) -> Floats:
        """Amplitudes of the steady acceleration at multiples of the command's frequency, shape (m, orders) [m/s²]."""
        steady = self.last(STEADY_PERIODS)[:, :, 2]
        amplitudes = 2.0 / steady.shape[1] * np.abs(np.fft.rfft(steady, axis=1))
        return np.asarray(amplitudes[:, [STEADY_PERIODS * k for k in orders]])

    @property
    def spread(self) -> dict[str, float]:
        """How far the runs lie apart in position, velocity and acceleration, relative to their size [-].

        The root mean square, over the steady part, of the difference between the runs with the least and the greatest
        value, over that of their mean; the drift of an open-loop position is left out.
        """
        steady = self.last(STEADY_PERIODS)
        steady = steady - steady.mean(axis=1, keepdims=True)
        low, high = steady[int(np.argmin(self.values))], steady[int(np.argmax(self.values))]
        found = np.std(high - low, axis=0) / np.std(0.5 * (high + low), axis=0)
        return dict(zip(CHANNELS, found.tolist(), strict=True))

    @property
    def shown(self) -> tuple[Floats, Floats]:
        """Time (k,) [s] and motion (m, k, 3) of the last periods, the position about its mean."""
        motion = self.last(SHOWN_PERIODS).copy()
        motion[:, :, 0] -= motion[:, :, 0].mean(axis=1, keepdims=True)
        samples = np.arange(self.motion.shape[1], dtype=np.float64)
        return samples[-motion.shape[1] :] * self.sample_time, motion

    @property
    def labels(self) -> list[str]:
        """Legend of each run."""
        symbol, unit = SYMBOLS[self.name]
        return [f"{symbol} = {value:g} {unit}".rstrip() for value in self.values.tolist()]


@dataclass(frozen=True, repr=False)
class Sensitivity:
    """Simulations with one parameter changed at a time."""

    studies: Mapping[str, ParameterStudy]  # simulations by parameter

    def summary(self) -> dict[str, Any]:
        """Odd harmonics of the acceleration [m/s²] and spread of the motion [-], per parameter."""
        odd = range(1, HIGHEST_HARMONIC + 1, 2)
        return {
            name: {
                "values": study.values.tolist(),
                "odd_harmonics": study.harmonics(odd).tolist(),
                "spread": study.spread,
            }
            for name, study in self.studies.items()
        }

    def plot(self) -> dict[str, Figure]:
        """Figures 6.19 to 6.24 by number."""
        drawn = [chart for study in self.studies.values() for chart in charts("this study", study)]
        return {chart.name.removeprefix("figure_"): static_figure(chart) for chart in drawn}

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
        for name, study in self.studies.items():
            spread = "  ".join(f"{key} {value:6.1%}" for key, value in study.spread.items())
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
    commands = sine(settings, settings["periods"] / frequency, dt)
    studies = {}
    for name in NUMBERS:
        thetas = [settings["base"] | {name: value} for value in settings[name]]
        tables = [table.with_values(values_of(table, settings["flow_coefficient"], changed)) for changed in thetas]
        vectors = np.array([one.vector() for one in tables])
        starts = np.array([initial_state(vector) for vector in vectors])
        motion = run_batch(vectors, starts, commands, dt, columns=(0, 1, 2))
        studies[name] = ParameterStudy(name, np.array(settings[name], dtype=float), frequency, dt, motion)
    return Sensitivity(studies)


STUDIES = {"thesis": "table 6.8", "table_6_9": "table 6.9"}
BEYOND = (3, 5, 7, 9, 11)  # orders among which the dominant harmonic is sought


def dominant(study: ParameterStudy) -> list[float]:
    """Frequency of the largest harmonic beyond the fundamental for each value [Hz]."""
    return [BEYOND[int(i)] * study.frequency for i in np.argmax(study.harmonics(BEYOND), axis=1)]


def charts(title: str, study: ParameterStudy) -> list[Chart]:
    """Motion over the last periods (figures 6.19, 6.21, 6.23), harmonics of the acceleration (6.20, 6.22, 6.24)."""
    time, motion = study.shown
    orders = range(1, HIGHEST_HARMONIC + 1)
    amplitudes, frequencies = study.harmonics(orders), study.frequency * np.array(orders)

    def curves(runs: Floats, kind: str) -> tuple[ChartSeries, ...]:
        return tuple(
            ChartSeries(label, run, f"c{i}", kind=kind)
            for i, (label, run) in enumerate(zip(study.labels, runs, strict=True))
        )

    over_time = [
        Panel(f"{channel} [{unit}]", time, curves(motion[:, :, column], "line"))
        for column, (channel, unit) in enumerate(CHANNELS.items())
    ]
    over_frequency = [Panel("acceleration [m/s²]", frequencies, curves(amplitudes, "marks"), log=True)]
    kinds = (
        ("motion", "time [s]", over_time),
        ("harmonics of the acceleration", "frequency [Hz]", over_frequency),
    )
    return [
        Chart(
            f"figure_{number}",
            x,
            tuple(panels),
            f"As figure {number.replace('_', '.')}: {what} for values of {NAMES[study.name]}, {title}",
        )
        for number, (what, x, panels) in zip(NUMBERS[study.name], kinds, strict=True)
    ]


def run(progress: Progress) -> ExperimentReport:
    """The study on both tables."""
    found = {}
    for i, (study, title) in enumerate(STUDIES.items()):
        progress(f"sensitivity, {title}", i / len(STUDIES))
        found[title] = sensitivity(study).studies
    claims = [claim for title, studies in found.items() for claim in _claims(title, studies)]
    rows = [
        [
            title,
            NAMES[name],
            *(f"{100.0 * v:.1f} %" for v in study.spread.values()),
            ", ".join(f"{f:g}" for f in dominant(study)),
        ]
        for title, studies in found.items()
        for name, study in studies.items()
    ]
    head = ("plant", "parameter", "position", "velocity", "acceleration", "dominant harmonic [Hz], by value")
    drawn = [chart for title, studies in found.items() for study in studies.values() for chart in charts(title, study)]
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


def _claims(title: str, studies: Mapping[str, ParameterStudy]) -> list[Claim]:
    felt = {name: study.spread["acceleration"] for name, study in studies.items()}
    moved = {name: study.spread["velocity"] for name, study in studies.items()}
    shown = ", ".join(f"{NAMES[n]} {100.0 * felt[n]:.0f} %" for n in NAMES)
    harmonics = dominant(studies["theta_5"])
    velocity = np.std(studies["theta_7"].last(STEADY_PERIODS)[:, :, 1], axis=1)
    sizes = (velocity / velocity[0]).tolist()
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
