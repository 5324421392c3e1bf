"""Charts of a fit: measured against simulated with the residuals, spectra, the residual against what may rule it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import welch

from shake_ros.explain.account import Account
from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.least_squares import Fit
from shake_ros.fit.records import Record
from shake_ros.physics.effects.unlisted import CHANGES, NODES, SECONDS
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.search.closed_form import FunctionForm
from shake_ros.search.unlisted_functions import ABOVE_NAMES, BELOW_NAMES, NODE_NAMES, PREFIX
from shake_ros.signals.stretches import energies
from shake_ros.signals.velocity_filter import filtered_velocity

LABELS = {
    "position": "position [mm]",
    "velocity": "velocity [m/s]",
    "direction": "direction",
    "load_pressure": "load pressure [MPa]",
    "valve_opening": "valve opening [%]",
    "flow": "valve opening · √pressure drop [% √MPa]",
    "time": "time [s]",
    "frequency": "frequency [Hz]",
    "phase": "time within the period [s]",
}
SCALES = {"position": 1e3, "load_pressure": 1e-6, "valve_opening": 1e2, "flow": 0.1}
FUNCTIONS = {  # kind of effects/unlisted.py → its quantity, label and scale
    1: ("position", "force against +x [N]", 1.0),
    2: ("position", "additional dry friction [N]", 1.0),
    3: ("velocity", "additional force against motion [N]", 1.0),
    4: ("valve_opening", "relative change of flow gain [-]", 1.0),
    5: ("load_pressure", "additional leakage [cm³/s]", 1e6),
    6: ("load_pressure", "relative change of stiffness [-]", 1.0),
    7: ("time", "relative change of flow gain [-]", 1.0),
    8: ("phase", "relative change of supply pressure [-]", 1.0),
    9: ("position", "relative change of dry friction [-]", 1.0),
}
SHOWN = 2.0  # of a recording at first [s]
GROUPS = 30  # of the abscissa of a residual
BANDS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, np.inf)  # [Hz]
BOTH = ("declared model", "extended model")


def free_runs(
    record: Record, before: TableParameters, after: TableParameters, model: DeclaredModel = FULL
) -> tuple[Array, Array]:
    """Free runs of both tables over a recording, columns as the model gives them: position, velocity, acceleration …"""
    return model.run(before, record), model.run(after, record)


def fastest_segment(record: Record, seconds: float) -> slice:
    """The segment of a recording with the largest mean square velocity."""
    n = min(round(seconds / record.sample_time), len(record.commands) - record.start)
    first = record.start + int(np.argmax(energies(record.velocity[record.start :], n)))
    return slice(first, first + n)


def residuals(record: Record, runs: Sequence[Array]) -> list[tuple[str, Array, list[Array]]]:
    """Channel with unit, what was measured, measured minus simulated of each run; from the first sample compared."""
    span = slice(record.start, None)
    filtered = [filtered_velocity(run[:, 1], record.sample_time) for run in runs]
    found = list[tuple[str, Array, list[Array]]]()
    if record.position_measured:
        found.append(("velocity [m/s]", record.velocity[span], [(record.velocity - v)[span] for v in filtered]))
    if record.acceleration is not None:
        felt = record.acceleration
        found.append(("acceleration [m/s²]", felt[span], [(felt - run[:, 2])[span] for run in runs]))
    return found


def history_chart(
    record: Record, runs: Sequence[Array], labels: Sequence[str] = BOTH, seconds: float = SHOWN, role: str = ""
) -> Chart:
    """The whole recording, measured and simulated before and after, each channel with its residual below."""
    dt = record.sample_time
    span = fastest_segment(record, seconds)
    time = np.arange(record.start, len(record.commands)) * dt + record.begin
    panels = []
    for label, measured, rests in residuals(record, runs):
        unit = label.split(" ")[1]
        looks = (("before", "line"), ("after", "dashed"))[-len(runs) :]
        curves = [ChartSeries("measured", measured, "measured", width=1.8)]
        curves += [
            ChartSeries(text, measured, colour, minus=rest, kind=kind)
            for text, rest, (colour, kind) in zip(labels, rests, looks, strict=True)
        ]
        left = [
            ChartSeries(f"measured − {text}", rest, colour)
            for text, rest, (colour, _) in zip(labels, rests, looks, strict=True)
        ]
        panels += [Panel(label, time, tuple(curves)), Panel(f"residual {unit}", time, tuple(left), height=120)]
    view = (float(time[span.start - record.start]), float(time[span.stop - 1 - record.start]))
    caption = f"{record.name}{role}: simulated from the recorded command alone; initially "
    caption += f"the {view[1] - view[0]:.1f} s of fastest motion"
    return Chart(f"history_{record.name}", "time [s]", tuple(panels), caption, view=view)


def spectrum_chart(record: Record, runs: Sequence[Array], labels: Sequence[str] = BOTH) -> Chart:
    """Amplitude spectral densities of the measured acceleration, or velocity, and of the residuals."""
    label, measured, rests = residuals(record, runs)[-1]
    colours = ("before", "after")[-len(runs) :]
    signals = [measured, *rests]
    names = ["measured", *(f"measured − {text}" for text in labels)]
    length = min(2048, max(len(measured) // 4, 64))
    series = []
    for name, signal, colour in zip(names, signals, ("measured", *colours), strict=True):
        frequency, power = welch(signal, 1.0 / record.sample_time, nperseg=length)
        series.append(ChartSeries(name, np.sqrt(power[1:]), colour, width=1.4))
    panel = Panel(label.replace("]", "/√Hz]"), frequency[1:], tuple(series), log=True, height=230)
    view = (0.4, 0.5 / record.sample_time)
    caption = f"{record.name}: amplitude spectral density of the measurement and of each model's residual"
    return Chart(f"spectrum_{record.name}", "frequency [Hz]", (panel,), caption, log_x=True, view=view)


def band_errors(record: Record, runs: Sequence[Array]) -> tuple[str, list[tuple[str, list[float]]]]:
    """Rms of the residual by band of frequency over the measured rms, for the last channel of `residuals`.

    The squares of a run's bands add up to the square of its error.
    """
    label, measured, rests = residuals(record, runs)[-1]
    n = len(measured)
    frequency = np.fft.rfftfreq(n, record.sample_time)
    twice = np.where((frequency == 0.0) | ((n % 2 == 0) & (np.arange(len(frequency)) == n // 2)), 1.0, 2.0)
    powers = [twice * np.abs(np.fft.rfft(rest)) ** 2 / n**2 for rest in rests]
    rows = []
    for low, high in zip(BANDS[:-1], BANDS[1:], strict=True):
        inside = (frequency >= low) & (frequency < high)
        if not inside.any():
            continue
        name = f"from {low:g} Hz" if np.isinf(high) else f"{low:g} … {high:g} Hz"
        rows.append((name, [float(np.sqrt(p[inside].sum()) / np.std(measured)) for p in powers]))
    return label.split(" ")[0], rows


def residual_charts(
    record: Record, runs: tuple[Array, Array], depends_on: Sequence[str], mass: float, model: DeclaredModel = FULL
) -> list[Chart]:
    """Mean residual against what the effect depends on, before and after, over groups of equal count.

    The residual is the force M·(measured − simulated acceleration), or that of the velocity where no acceleration is.
    """
    known = [model.quantities(record, run) for run in runs]
    wanted = [n for n in dict.fromkeys(depends_on) if n in known[0] and n not in ("direction", "time")]
    names = wanted or [n for n in ("load_pressure", "valve_opening", "velocity") if n in known[0]][-2:]
    label, _, rests = residuals(record, runs)[-1]
    if record.acceleration is not None:
        label = "force [N]" if mass != 1.0 else "force per mass [m/s²]"
        rests = [mass * rest for rest in rests]
    charts = []
    for name in names:
        places = [SCALES.get(name, 1.0) * quantities[name][record.start :] for quantities in known]
        edges = group_edges(places[1])
        if len(edges) < 3:
            continue
        middle = 0.5 * (edges[:-1] + edges[1:])
        series = [
            ChartSeries(text, group_means(rest, at, edges), colour, width=2.0)
            for text, rest, at, colour in zip(BOTH, rests, places, ("before", "after"), strict=True)
        ]
        panel = Panel(f"residual {label}", middle, tuple(series), height=210)
        caption = f"{record.name}: mean residual against {name.replace('_', ' ')}, {len(middle)} groups of equal count"
        charts.append(Chart(f"residual_{name}_{record.name}", LABELS[name], (panel,), caption))
    return charts


def group_edges(at: Array) -> Array:
    """Ends of groups of equal count; fewer than three where the values do not differ."""
    return np.unique(np.quantile(at, np.linspace(0.0, 1.0, GROUPS + 1)))


def group_means(values: Array, at: Array, edges: Array) -> Array:
    """Mean of the values in each group of their abscissa, NaN where it is empty."""
    groups = len(edges) - 1
    group = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, groups - 1)
    count = np.bincount(group, minlength=groups)
    return np.where(count > 0, np.bincount(group, values, minlength=groups) / np.maximum(count, 1), np.nan)


def unlisted_chart(fit: Fit, form: FunctionForm | None = None) -> Chart:
    """The estimated function on its nodes, and its closed form; of two quantities at three values of the second."""
    table = fit.table
    low, high = (table.value(f"{PREFIX}{end}") for end in ("low", "high"))
    nodes = np.linspace(low, high, NODES)
    values = np.array([table.value(name) for name in NODE_NAMES])
    quantity, label, scale = FUNCTIONS[int(table.value(PREFIX + "kind"))]
    code = int(table.value(PREFIX + "second"))
    at, caption, named = nodes, "The unlisted effect, as estimated on its knots", "estimated"
    series = list[ChartSeries]()
    if code:
        changes = np.linspace(low, high, CHANGES)
        at = np.union1d(nodes, changes)
        ends = [table.value(f"{PREFIX}second_{end}") for end in ("low", "high")]
        caption += f", at the ends and in the middle of the range of {SECONDS[code].replace('_', ' ')}"
        named = second_label(code, 0.5 * (ends[0] + ends[1]))
        for end, names, colour in ((ends[0], BELOW_NAMES, "c3"), (ends[1], ABOVE_NAMES, "c4")):
            changed = np.interp(at, changes, [table.value(name) for name in names]) + np.interp(at, nodes, values)
            series.append(ChartSeries(second_label(code, end), scale * changed, colour, width=1.8))
    middle = ChartSeries(named, scale * np.interp(at, nodes, values), "after", width=1.8)
    series.insert(len(series) // 2, middle)
    if form:
        series.append(ChartSeries(form.name, scale * np.interp(at, nodes, form.values), "c0"))
    panel = Panel(label, at * SCALES.get(quantity, 1.0), tuple(series), height=210)
    return Chart("unlisted", LABELS[quantity], (panel,), caption)


def second_label(code: int, value: float) -> str:
    """A value of a second quantity with its name and unit."""
    name, _, unit = LABELS[SECONDS[code]].rpartition(" [")
    return f"{name} {value * SCALES.get(SECONDS[code], 1.0):.3g} {unit.rstrip(']')}"


def correlation_chart(accounts: Sequence[Account], with_drive: bool) -> Chart:
    """Correlation of every tested residual with its own past, or with the drive; grey: 99 % by chance at one lag."""
    panels = []
    for each in accounts:
        test = each.shape
        if test is None:
            continue
        lags = len(test.autocorrelation) - 1
        lag = np.arange(-lags if with_drive else 1, lags + 1, dtype=np.float64)
        value = test.cross_correlation if with_drive else test.autocorrelation[1:]
        bound = test.cross_bound if with_drive else test.auto_bound
        series = (ChartSeries(each.label, value, "c0", kind="points"),)
        panels.append(Panel("correlation", lag, series, height=100, shaded=(-bound, bound)))
    name, text = ("drive", "the drive") if with_drive else ("past", "its own past")
    caption = f"Correlation of the residual with {text}; grey: 99 % limits of chance, lag by lag"
    return Chart(f"correlation_{name}", "lag [samples]", tuple(panels), caption)
