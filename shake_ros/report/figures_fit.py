"""Figures of a fit: time histories and spectra measured against simulated, before and after; ranking; residual."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import welch

from shake_ros.core.discovery.refit import Refit
from shake_ros.core.effects.unlisted import NODES
from shake_ros.core.identification.fit import Fit
from shake_ros.core.identification.recordings import FULL, DeclaredModel, Record, low_pass
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.report.style import AFTER, BEFORE, MEASURED, new_figure, tidy

LABELS = {
    "position": "position [mm]",
    "velocity": "velocity [m/s]",
    "direction": "direction",
    "load_pressure": "load pressure [bar]",
    "valve_opening": "valve opening [-]",
    "flow": "relative flow [sqrt(Pa)]",
    "time": "time [s]",
    "frequency": "frequency [Hz]",
    "phase": "time within the period [s]",
}
SCALES = {"position": 1e3, "load_pressure": 1e-5}
FUNCTIONS = {  # kind of effects/unlisted.py → its quantity, label and scale
    1: ("position", "force against +x [N]", 1.0),
    2: ("position", "additional dry friction [N]", 1.0),
    3: ("velocity", "additional force against motion [N]", 1.0),
    4: ("valve_opening", "relative change of flow gain [-]", 1.0),
    5: ("load_pressure", "additional leakage [cm³/s]", 1e6),
    6: ("load_pressure", "relative change of stiffness [-]", 1.0),
    7: ("time", "relative change of flow gain [-]", 1.0),
    8: ("phase", "relative change of supply pressure [-]", 1.0),
}


def free_runs(
    record: Record, before: TableParameters, after: TableParameters, model: DeclaredModel = FULL
) -> tuple[np.ndarray, np.ndarray]:
    """Free runs of both tables over a recording, columns as the model gives them: position, velocity, acceleration …"""
    return model.run(before, record), model.run(after, record)


def fastest_stretch(record: Record, seconds: float) -> slice:
    """The stretch of a recording with the largest mean square velocity."""
    n = min(round(seconds / record.sample_time), len(record.commands) - record.start)
    power = np.convolve(record.velocity[record.start :] ** 2, np.ones(n), mode="valid")
    first = record.start + int(np.argmax(power))
    return slice(first, first + n)


def time_histories(
    record: Record,
    before: np.ndarray,
    after: np.ndarray,
    seconds: float = 2.0,
    labels: tuple[str, str] = ("declared model", "extended model"),
) -> Figure:
    """Velocity and acceleration of the stretch of fastest motion, measured and simulated before and after."""
    span = fastest_stretch(record, seconds)
    time = np.arange(len(record.commands))[span] * record.sample_time
    channels = [(record.velocity, 1, "velocity [m/s]")]
    if record.acceleration is not None:
        channels.append((record.acceleration, 2, "acceleration [m/s²]"))
    figure = new_figure(9.5, 2.6 * len(channels))
    rows = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (measured, column, label) in zip(rows, channels, strict=True):
        simulated = [
            low_pass(r[:, column], record.sample_time) if column == 1 else r[:, column] for r in (before, after)
        ]
        axes.plot(time, measured[span], color=MEASURED, linewidth=1.6, label="measured")
        axes.plot(time, simulated[0][span], color=BEFORE, linewidth=1.1, label=labels[0])
        axes.plot(time, simulated[1][span], color=AFTER, linewidth=1.1, linestyle="--", label=labels[1])
        tidy(axes, "time [s]" if axes is rows[-1] else "", label)
    rows[0].legend(loc="upper right", frameon=False, ncols=3)
    return figure


def spectra(record: Record, before: np.ndarray, after: np.ndarray) -> Figure:
    """Amplitude spectral densities of the measured acceleration and of both residuals."""
    figure = new_figure(9.5, 3.6)
    axes = figure.subplots()
    assert record.acceleration is not None
    curves = (
        (record.acceleration, MEASURED, "measured"),
        (record.acceleration - before[:, 2], BEFORE, "residual of the declared model"),
        (record.acceleration - after[:, 2], AFTER, "residual of the extended model"),
    )
    for values, colour, label in curves:
        n = min(4096, len(values) - record.start)
        frequency, power = welch(values[record.start :], 1.0 / record.sample_time, nperseg=n)
        axes.loglog(frequency[1:], np.sqrt(power[1:]), color=colour, linewidth=1.3, label=label)
    axes.set_xlim(0.4, 0.5 / record.sample_time)
    tidy(axes, "frequency [Hz]", "acceleration [m/s²/√Hz]")
    axes.legend(frameon=False)
    return figure


def ranking_figure(ranking: Sequence[Refit], baseline_hold: float) -> Figure:
    """Cost of each refitted candidate on the validation data."""
    figure = new_figure(9.5, 0.6 + 0.34 * (len(ranking) + 1))
    axes = figure.subplots()
    names = ["declared model", *(a.candidate.effect for a in reversed(ranking))]
    costs = [baseline_hold, *(a.result.validation_cost for a in reversed(ranking))]
    colours = [MEASURED, *[BEFORE] * (len(ranking) - 1), AFTER][: len(names)]
    axes.barh(names, np.sqrt(costs), color=colours, height=0.62)
    axes.set_xscale("log")
    tidy(axes, "rms of the weighted residual on the validation data [-]", "")
    axes.grid(False, axis="y")
    return figure


def residual_figure(
    record: Record,
    before: np.ndarray,
    after: np.ndarray,
    depends_on: Sequence[str],
    moved_mass: float,
    model: DeclaredModel = FULL,
) -> Figure:
    """Residual force M·(measured − simulated acceleration) against what the effect depends on, before and after.

    Where the recording has no acceleration, the residual is that of the velocity.
    """
    known = model.quantities(record, before)
    wanted = dict.fromkeys(n for n in depends_on if n in known and n != "direction")
    names = list(wanted) or [n for n in ("load_pressure", "valve_opening", "velocity") if n in known][-2:]
    force_label = "residual force [N]" if moved_mass != 1.0 else "residual force per mass [m/s²]"
    label_y = "residual velocity [m/s]" if record.acceleration is None else force_label
    figure = new_figure(9.5, 3.4)
    row = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    for axes, name in zip(row, names, strict=True):
        for run_, colour, label in ((before, BEFORE, "declared"), (after, AFTER, "extended")):
            x = model.quantities(record, run_)[name][record.start :] * SCALES.get(name, 1.0)
            if record.acceleration is None:
                rest = (record.velocity - low_pass(run_[:, 1], record.sample_time))[record.start :]
            else:
                rest = moved_mass * (record.acceleration - run_[:, 2])[record.start :]
            axes.plot(x, rest, ".", color=colour, markersize=1.4, alpha=0.35, rasterized=True)
            edges = np.quantile(x, np.linspace(0, 1, 31))
            group = np.clip(np.searchsorted(edges, x) - 1, 0, 29)
            count = np.maximum(np.bincount(group, minlength=30), 1)
            mean_x = np.bincount(group, x, minlength=30) / count
            mean_force = np.bincount(group, rest, minlength=30) / count
            axes.plot(mean_x, mean_force, color=colour, linewidth=2.2, label=label)
        tidy(axes, LABELS[name], label_y if axes is row[0] else "")
    row[0].legend(frameon=False)
    return figure


def unlisted_figure(fit: Fit) -> Figure:
    """The estimated function on its nodes."""
    table = fit.free.table(fit.x)
    low, high = (table.value(f"effects.unlisted.{end}") for end in ("low", "high"))
    values = np.array([table.value(f"effects.unlisted.node_{i:02d}") for i in range(NODES)])
    quantity, label, scale = FUNCTIONS[int(table.value("effects.unlisted.kind"))]
    figure = new_figure(9.5, 3.2)
    axes = figure.subplots()
    axes.plot(np.linspace(low, high, NODES) * SCALES.get(quantity, 1.0), values * scale, ".-", color=AFTER)
    tidy(axes, LABELS[quantity], label)
    return figure
