"""Figures of the fluid: bulk modulus with entrained air (figure 2.4) and the empirical formulas (figure 2.5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shake_ros.core.bulk_modulus import BULK_MODULI, BulkModulusLaw
from shake_ros.core.bulk_modulus.selected import moduli
from shake_ros.report.style import COLOURS, new_figure, tidy
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


def law(name: str) -> BulkModulusLaw:
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
            found = moduli(law(name).replace(fraction=fraction), axis)
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
        axes.plot(axis * 1e-5, moduli(law(name), axis) * 1e-9, color=colour, linewidth=1.7, label=label)
    draw_axes(axes, "Effective bulk modulus after Lee, Hoffmann and Eggerth")
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    return figure
