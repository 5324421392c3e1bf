"""The section on the force that a model lacks: how large, of what kind, over time and against velocity and position."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.discovery.latent_force import LatentForce
from shake_ros.core.identification.recordings import DeclaredModel
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.charts_fit import GROUPS, LABELS, SCALES, SHOWN
from shake_ros.report.page import Page
from shake_ros.report.text import largest_force, sentence, told_force

WHAT = (
    "What would have to act on the table for the final model to give the measured motion: a state of its own, smoothed "
    "over the whole recording. A fault of valve, oil or supply shows as the force that it would take in its place. The "
    "table says what a run leaves without and with the force, and up to which frequency it stands out of the noise."
)
SIDES = {  # abscissa → the quantity whose sign parts the two curves, and their names
    "velocity": ("acceleration", ("gaining speed to +x", "gaining speed to −x")),
    "position": ("velocity", ("moving to +x", "moving to −x")),
}


def force_section(page: Page, forces: Sequence[LatentForce], model: DeclaredModel) -> None:
    """One sentence where the force is zero; else sizes, kinds and the charts of the largest one."""
    if not forces:
        return
    page.heading("The force that the model lacks")
    page.paragraph(sentence(told_force(forces)))
    if all(force.kinds.zero for force in forces):
        return
    gauge = " Newtons count relative to the area that was assumed." if model.nuisances else ""
    page.paragraph(f"{WHAT}{gauge}", note=True)
    page.table(
        ("recording", "rms", "peak", "of inertia", "the force", "run leaves, × noise", "up to"),
        [_row(f) for f in forces],
    )
    force = largest_force(forces)
    page.chart(force_chart(force))
    for name in SIDES:
        chart = against_chart(force, name)
        if chart:
            page.chart(chart)


def _row(force: LatentForce) -> list[str]:
    share = f"{100.0 * force.of_inertia:.1f} %"
    role = "validation" if force.held_out else "estimation"
    left = f"{force.left[0]:.2f}" if force.kinds.zero else f"{force.left[0]:.2f} → {force.left[1]:.2f}"
    sizes = [f"{size:.3g} {force.unit}" for size in (force.rms, force.peak)]
    return [
        f"{force.recording} ({role})",
        *sizes,
        share,
        force.kinds.text,
        left,
        "–" if force.kinds.zero else f"{force.bandwidth:.0f} Hz",
    ]


def force_chart(force: LatentForce) -> Chart:
    """The force over time with its band, and the velocity below; at first about its largest power."""
    lower, upper = force.ends
    series = (
        ChartSeries("force", force.force, "after", width=1.6),
        ChartSeries("upper end", upper, "grey", width=0.6),
        ChartSeries("lower end", lower, "grey", width=0.6),
        ChartSeries("zero", np.zeros(len(force.force)), "measured", kind="dashed", width=1.0),
    )
    panels = (
        Panel(
            f"{'force' if force.unit == 'N' else 'force per mass'} [{force.unit}]",
            force.time,
            series,
            height=210,
            band=(1, 2),
        ),
        Panel(
            "velocity [m/s]", force.time, (ChartSeries("velocity", force.known["velocity"], "measured"),), height=110
        ),
    )
    role = "validation" if force.held_out else "estimation"
    caption = f"{force.recording} ({role}): the force that the model lacks, with its {100.0 * force.band:.0f} % band"
    return Chart(f"force_{force.recording}", "time [s]", panels, caption, view=_strongest(force))


def _strongest(force: LatentForce) -> tuple[float, float]:
    """The stretch of largest power."""
    step = float(force.time[1] - force.time[0])
    n = min(round(2.0 * SHOWN / step), len(force.time) - 1)
    power = np.concatenate(([0.0], np.cumsum(force.force**2)))
    first = int(np.argmax(power[n:] - power[:-n]))
    return float(force.time[first]), float(force.time[min(first + n, len(force.time)) - 1])


def against_chart(force: LatentForce, name: str) -> Chart | None:
    """Mean force against a quantity, apart for either sense of motion: two curves that part tell of a memory."""
    by, (low, high) = SIDES[name]
    sense = np.gradient(force.known["velocity"]) if by == "acceleration" else force.known[by]
    at = SCALES.get(name, 1.0) * force.known[name]
    edges = np.unique(np.quantile(at, np.linspace(0.0, 1.0, GROUPS + 1)))
    if len(edges) < 3:
        return None
    middle = 0.5 * (edges[:-1] + edges[1:])
    group = np.asarray(np.clip(np.searchsorted(edges, at, side="right") - 1, 0, len(middle) - 1), dtype=np.intp)
    series = [
        ChartSeries(label, _means(force.force[side], group[side], len(middle)), colour, kind="marks", width=1.6)
        for label, side, colour in ((low, sense > 0.0, "c0"), (high, sense <= 0.0, "c1"))
    ]
    series.append(ChartSeries("zero", np.zeros(len(middle)), "measured", kind="dashed", width=1.0))
    panel = Panel(f"mean force [{force.unit}]", middle, tuple(series), height=210)
    caption = f"{force.recording}: mean force against {name}, {len(middle)} groups of equal count"
    return Chart(f"force_{name}_{force.recording}", LABELS[name], (panel,), caption)


def _means(values: Array, group: NDArray[np.intp], count: int) -> Array:
    """Mean by group, NaN where it is empty."""
    number = np.bincount(group, minlength=count)
    total = np.bincount(group, values, minlength=count)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
