"""Figures of the laws: bulk modulus (2.4, 2.5), steady friction (3.6), what dynamic friction shows (3.7–3.10)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shake_ros.core.bulk_modulus import BULK_MODULI, BulkModulusLaw, moduli
from shake_ros.core.friction import FRICTIONS, steady_force
from shake_ros.core.friction.response import break_away_force, pulled_block, under_motion
from shake_ros.core.packing import record
from shake_ros.report.chart import COLOURS, new_figure, tidy
from shake_ros.settings import find, load_variant, read_yaml

WITH_AIR = {
    "wylie_kajaste": "Wylie–Kajaste (2.29)",
    "nykanen": "Nykänen (2.30)",
    "backe_murrenhoff": "Backé–Murrenhoff (2.31)",
    "ifas": "IFAS (2.32)",
}
EMPIRICAL = {
    "lee": "Lee (2.37)",
    "hoffmann": "Hoffmann (2.38)",
    "eggerth": "Eggerth (2.39), 20 °C",
    "eggerth_50": "Eggerth, 50 °C",
    "eggerth_90": "Eggerth, 90 °C",
}


def fluid_law(name: str) -> BulkModulusLaw:
    """The law of config/bulk_modulus/<name>.yaml."""
    return load_variant("bulk_modulus", name, BULK_MODULI)[1]


def pressures() -> tuple[np.ndarray, Sequence[float]]:
    """Pressures of the abscissa [Pa] and air fractions [-], from config/figures/fluid.yaml."""
    settings = read_yaml(find("figures", "fluid"))
    axis = np.linspace(settings["lowest_pressure"], settings["highest_pressure"], 600)
    return axis, settings["air_fractions"]


def draw_axes(axes: Axes, title: str) -> None:
    """Pressure in bar and modulus in GPa, both from zero."""
    tidy(axes, "pressure [bar]", "effective bulk modulus [GPa]", title)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)


def entrained_air() -> Figure:
    """Figure 2.4: effective bulk modulus against pressure for several air contents after four models."""
    axis, fractions = pressures()
    figure = new_figure(9.0, 6.6)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for axes, fraction in zip(np.ravel(panels), fractions, strict=True):
        for (name, label), colour, style in zip(WITH_AIR.items(), COLOURS, ("-", "--", ":", "-"), strict=False):
            found = moduli(fluid_law(name).replace(fraction=fraction), axis)
            axes.plot(axis * 1e-5, found * 1e-9, style, color=colour, linewidth=1.7, label=label)
        draw_axes(axes, f"air content {100.0 * fraction:g} %")
    np.ravel(panels)[0].legend(frameon=False, fontsize=8, loc="lower right")
    for axes in np.ravel(panels):
        axes.label_outer()
    return figure


def empirical() -> Figure:
    """Figure 2.5: the empirical formulas for the effective bulk modulus against pressure."""
    axis, _ = pressures()
    figure = new_figure(7.0, 4.6)
    axes = figure.subplots()
    for (name, label), colour in zip(EMPIRICAL.items(), COLOURS, strict=False):
        axes.plot(axis * 1e-5, moduli(fluid_law(name), axis) * 1e-9, color=colour, linewidth=1.7, label=label)
    draw_axes(axes, "Effective bulk modulus after Lee, Hoffmann and Eggerth")
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    return figure


CURVES = ("coulomb_viscous_static", "tustin", "hess_soom", "bo_pavelescu", "marton_lantos", "armstrong")
BRISTLES = ("lugre", "modified_lugre", "new_modified_lugre")
KEPT = 50  # one row in so many of a pulled block


def law(name: str) -> Any:
    """The record of config/friction/<name>.yaml."""
    return record("friction", FRICTIONS, load_variant("friction", name, FRICTIONS)[1])


def settings() -> dict[str, Any]:
    """The content of config/figures/friction.yaml."""
    content: dict[str, Any] = read_yaml(find("figures", "friction"))
    return content


def curves() -> Figure:
    """Figure 3.6: steady friction force over velocity, the laws as curves and the bristle laws by direction."""
    highest = settings()["highest_velocity"]
    figure = new_figure(11.0, 4.2)
    left, right = figure.subplots(1, 2)
    v = np.linspace(-highest, highest, 2001)
    for axes, names in ((left, CURVES), (right, BRISTLES)):
        for name, colour in zip(names, COLOURS, strict=False):
            p = law(name)
            force = [steady_force(p, float(x)) for x in v]
            style = "--" if name == "new_modified_lugre" else "-"
            axes.plot(v, force, style, color=colour, linewidth=1.5, label=name.replace("_", " "))
        axes.legend(frameon=False, fontsize=8, loc="upper left")
    tidy(left, "velocity [m/s]", "friction force [N]", "levels of table 6.8")
    tidy(right, "velocity [m/s]", "friction force [N]", "tables 6.5, 6.6, 6.7")
    return figure


def lag() -> Figure:
    """Figure 3.7: friction follows a change of velocity late; the loop opens with the rate of change."""
    s = settings()
    p, dt, part = law(s["block"]), s["sample_time"], s["lag"]
    figure = new_figure(6.5, 4.2)
    axes = figure.subplots()
    for omega, colour in zip(part["rates"], COLOURS, strict=False):
        t = np.arange(round(4.0 * np.pi / omega / dt)) * dt
        velocity = part["velocity"] * (1.0 + part["swing"] * np.cos(omega * t))
        last = slice(len(t) // 2, None)
        axes.plot(1e3 * velocity[last], under_motion(p, velocity, dt)[last], color=colour, label=f"{omega:g} rad/s")
    axes.legend(frameon=False, fontsize=9)
    tidy(axes, "velocity [mm/s]", "friction force [N]")
    return figure


def reversal() -> Figure:
    """Figure 3.8: force over velocity through zero, a loop that depends on the rate."""
    s = settings()
    p, dt, part = law(s["block"]), s["sample_time"], s["reversal"]
    figure = new_figure(6.5, 4.2)
    axes = figure.subplots()
    for frequency, colour in zip(part["frequencies"], COLOURS, strict=False):
        t = np.arange(round(2.0 / frequency / dt)) * dt
        velocity = part["velocity"] * np.sin(2.0 * np.pi * frequency * t)
        last = slice(len(t) // 2, None)
        axes.plot(1e3 * velocity[last], under_motion(p, velocity, dt)[last], color=colour, label=f"{frequency:g} Hz")
    axes.legend(frameon=False, fontsize=9)
    tidy(axes, "velocity [mm/s]", "friction force [N]")
    return figure


def presliding() -> Figure:
    """Figure 3.9: force over position before sliding, with an inner loop where the motion turns back on its way.

    The law has no non-local memory: after the inner loop it does not come back to the outer one as real contacts do.
    """
    s = settings()
    p, dt, part = law(s["block"]), s["sample_time"], s["presliding"]
    far, near, period = part["travel"], part["inner"], part["period"]
    turns = [0.0, far, -far, 0.0, -near, near * 0.5, far]
    corners = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))])
    t = np.arange(round(period / dt)) * dt
    position = np.interp(t / period * corners[-1], corners, turns)
    velocity = np.gradient(position, dt)
    figure = new_figure(6.5, 4.2)
    axes = figure.subplots()
    axes.plot(1e6 * np.cumsum(velocity) * dt, under_motion(p, velocity, dt), color=COLOURS[0])
    tidy(axes, "position [µm]", "friction force [N]")
    return figure


def stick_slip() -> Figure:
    """Figure 3.10: a block pulled by a spring at 1 mm/s sticks and slips."""
    s = settings()
    part, dt = s["stick_slip"], 1e-4
    pull = part["speed"] * np.arange(round(part["seconds"] / dt)) * dt
    rows = pulled_block(law(s["block"]), part["mass"], part["stiffness"], pull, dt, KEPT)
    t = np.arange(len(rows)) * KEPT * dt
    figure = new_figure(9.0, 6.0)
    panels = figure.subplots(3, 1, sharex=True)
    panels[0].plot(t, 1e3 * part["speed"] * t, color=COLOURS[5], linewidth=1.0, label="pulled end")
    panels[0].plot(t, 1e3 * rows[:, 0], color=COLOURS[0], label="block")
    panels[0].legend(frameon=False, fontsize=9)
    panels[1].plot(t, 1e3 * rows[:, 1], color=COLOURS[0])
    panels[2].plot(t, rows[:, 3], color=COLOURS[1], label="friction")
    panels[2].plot(t, rows[:, 2], color=COLOURS[5], linewidth=1.0, label="spring")
    panels[2].legend(frameon=False, fontsize=9)
    for axes, y in zip(panels, ("position [mm]", "velocity [mm/s]", "force [N]"), strict=True):
        tidy(axes, "time [s]" if axes is panels[2] else "", y)
    return figure


def break_away() -> Figure:
    """Break-away force over the rate at which the force grows."""
    s = settings()
    p, part, dt = law(s["block"]), s["break_away"], s["sample_time"]
    forces = []
    for rate in part["rates"]:
        pull = rate / part["stiffness"] * np.arange(round(4.0 / rate / dt)) * dt
        rows = pulled_block(p, 1.0, part["stiffness"], pull, dt, 10)
        forces.append(break_away_force(rows, part["travel"]))
    figure = new_figure(6.5, 4.0)
    axes = figure.subplots()
    axes.semilogx(part["rates"], forces, "o-", color=COLOURS[0])
    tidy(axes, "rate of the force [N/s]", "break-away force [N]")
    return figure
