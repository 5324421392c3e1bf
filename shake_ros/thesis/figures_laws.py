"""Figures of the laws: bulk modulus (2.4, 2.5), friction (3.6 to 3.10), valve (6.10, 6.11) and its flow force."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.packing import record
from shake_ros.physics.bulk_modulus import BULK_MODULI, BulkModulusLaw, moduli
from shake_ros.physics.friction import FRICTIONS, steady_force
from shake_ros.physics.friction.response import break_away_force, pulled_block, under_motion
from shake_ros.physics.valve import VALVES, linear_response, valve_response
from shake_ros.physics.valve.ports import steady_force as steady_flow_force
from shake_ros.quantities import Parameters
from shake_ros.report.chart import COLOURS, new_figure, tidy
from shake_ros.settings import find, load_table, load_variant, read_yaml
from shake_ros.signals.frequency_response import fundamental

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def settings(name: str) -> dict[str, Any]:
    """The content of a file of config/figures."""
    content: dict[str, Any] = read_yaml(find("figures", name))
    return content


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
    s = settings("fluid")
    return np.linspace(s["lowest_pressure"], s["highest_pressure"], 600), s["air_fractions"]


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


def curves() -> Figure:
    """Figure 3.6: steady friction force over velocity, the laws as curves and the bristle laws by direction."""
    highest = settings("friction")["highest_velocity"]
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


def force_loops(motions: Mapping[str, np.ndarray]) -> Figure:
    """Friction force over velocity (n,) of the second half of each motion."""
    s = settings("friction")
    p = law(s["block"])
    figure = new_figure(6.5, 4.2)
    axes = figure.subplots()
    for (label, velocity), colour in zip(motions.items(), COLOURS, strict=False):
        last = slice(len(velocity) // 2, None)
        axes.plot(1e3 * velocity[last], under_motion(p, velocity, s["sample_time"])[last], color=colour, label=label)
    axes.legend(frameon=False, fontsize=9)
    tidy(axes, "velocity [mm/s]", "friction force [N]")
    return figure


def lag() -> Figure:
    """Figure 3.7: friction follows a change of velocity late; the loop opens with the rate of change."""
    s = settings("friction")
    dt, part = s["sample_time"], s["lag"]
    motions = {}
    for omega in part["rates"]:
        t = np.arange(round(4.0 * np.pi / omega / dt)) * dt
        motions[f"{omega:g} rad/s"] = part["velocity"] * (1.0 + part["swing"] * np.cos(omega * t))
    return force_loops(motions)


def reversal() -> Figure:
    """Figure 3.8: force over velocity through zero, a loop that depends on the rate."""
    s = settings("friction")
    dt, part = s["sample_time"], s["reversal"]
    motions = {}
    for frequency in part["frequencies"]:
        t = np.arange(round(2.0 / frequency / dt)) * dt
        motions[f"{frequency:g} Hz"] = part["velocity"] * np.sin(2.0 * np.pi * frequency * t)
    return force_loops(motions)


def presliding() -> Figure:
    """Figure 3.9: force over position before sliding, with an inner loop where the motion turns back on its way.

    The law has no non-local memory: after the inner loop it does not come back to the outer one as real contacts do.
    """
    s = settings("friction")
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
    s = settings("friction")
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
    s = settings("friction")
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


PERIODS, POINTS = 6, 25  # of a sine that shows a valve's response, and frequencies of that response


def two_valves() -> tuple[dict[str, Any], dict[str, Parameters], float, float]:
    """Content of config/figures/valve.yaml, the two valves, supply and tank pressure [Pa]."""
    content = settings("valve")
    table = load_table(content["table"])
    valves: dict[str, Parameters] = {
        "two-stage": load_variant("valve", content["valve"], VALVES)[1],
        "second order": table.valve,
    }
    return content, valves, table.supply.supply_pressure, table.supply.tank_pressure


def spool_after_step(valve: Parameters, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [ms] and spool [-] after a step of the command, shape (n,)."""
    content, _, supply, tank = two_valves()
    dt = content["sample_time"]
    t = np.arange(round(content["seconds"] / dt)) * dt
    return 1e3 * t, valve_response(valve, np.full(len(t), size), dt, supply, tank)


def draw_steps(axes: Axes, label: str, valve: Parameters, style: str, colour: str) -> None:
    """Spool after each step of figure 6.10."""
    for i, size in enumerate(settings("valve")["steps"]):
        t, spool = spool_after_step(valve, size)
        axes.plot(t, 100.0 * spool, style, color=colour, linewidth=1.5, label=label if i == 0 else None)


def steps() -> Figure:
    """Figure 6.10: spool after steps of the command, two-stage valve and second-order model."""
    figure = new_figure(8.0, 4.6)
    axes = figure.subplots()
    for (name, valve), colour, style in zip(two_valves()[1].items(), COLOURS, ("-", "--"), strict=False):
        draw_steps(axes, name, valve, style, colour)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    tidy(axes, "time [ms]", "spool position [%]")
    return figure


def second_order_step() -> Figure:
    """Figure 6.11: spool of (6.7), (6.8) with the parameters of table 6.4 after a step of the command from 0 to 1."""
    figure = new_figure(8.0, 4.0)
    axes = figure.subplots()
    axes.plot(*spool_after_step(two_valves()[1]["second order"], 1.0), color=COLOURS[0], linewidth=1.5)
    tidy(axes, "time [ms]", "spool position [-]")
    return figure


def sine_response(valve: Parameters, amplitude: float, frequency: float, dt: float, p_s: float, p_t: float) -> complex:
    """Fundamental of the spool per command under a sine, the hold's half sample taken off [-]."""
    length = round((2 + PERIODS) / frequency / dt)
    command = amplitude * np.sin(2.0 * np.pi * frequency * np.arange(length) * dt)
    spool = valve_response(valve, command, dt, p_s, p_t)
    start = length - round(PERIODS / frequency / dt)
    lag = np.exp(-1j * np.pi * frequency * dt)
    return complex(fundamental(spool, frequency, dt, start) / amplitude / lag)


def gain_and_phase(
    curves: Sequence[tuple[str, np.ndarray, np.ndarray, str]], size: Callable[[np.ndarray], np.ndarray], gain_of: str
) -> Figure:
    """Gain and phase of curves, each its label, frequencies [Hz], response, both (n,), and line style."""
    figure = new_figure(8.0, 6.0)
    gain, phase = figure.subplots(2, 1, sharex=True)
    for (label, frequencies, response, style), colour in zip(curves, COLOURS, strict=False):
        gain.semilogx(frequencies, size(np.abs(response)), style, color=colour, label=label)
        phase.semilogx(frequencies, np.degrees(np.unwrap(np.angle(response))), style, color=colour)
    gain.legend(frameon=False, fontsize=9, loc="lower left")
    tidy(gain, "", gain_of)
    tidy(phase, "frequency [Hz]", "phase [°]")
    return figure


def frequency_response() -> Figure:
    """Gain and phase of the spool: both models linearised at null, and the two-stage valve under larger sines."""
    content, valves, supply, tank = two_valves()
    frequencies = np.geomspace(content["lowest_frequency"], content["highest_frequency"], POINTS)
    curves = [
        (f"{name}, linearised", frequencies, linear_response(valve, frequencies, supply, tank), style)
        for (name, valve), style in zip(valves.items(), ("-", "--"), strict=True)
    ]
    for amplitude in content["amplitudes"]:
        points = [
            sine_response(valves["two-stage"], amplitude, f, content["sample_time"], supply, tank) for f in frequencies
        ]
        curves.append((f"two-stage, {100.0 * amplitude:g} %", frequencies, np.array(points), ":"))
    return gain_and_phase(curves, lambda gain: np.asarray(20.0 * np.log10(gain)), "gain [dB]")


def flow_force() -> Figure:
    """Steady flow force over the spool at three load pressures, and the steps of figure 6.10 with it and with a spring.

    The spring is that of the valve without: force against the spool's way, and spool after steps of the command.
    """
    content, valves, supply, tank = two_valves()
    spring: Any = valves["two-stage"]
    jets: Any = load_variant("valve", content["with_flow_force"], VALVES)[1]
    p, middle = record("valve", VALVES, jets), 0.5 * (supply + tank)
    figure = new_figure(8.0, 6.0)
    force, reached = figure.subplots(2, 1)
    spool = np.linspace(-1.0, 1.0, 201)
    for load, colour in zip(content["load_pressures"], COLOURS, strict=False):
        ports = middle + 0.5 * load, middle - 0.5 * load, 0.0, 0.0
        drawn = [steady_flow_force(p, x, ports, supply, tank) for x in spool]
        force.plot(100.0 * spool, drawn, color=colour, label=f"load pressure {1e-5 * load:g} bar")
    straight = spring.flow_force_stiffness * spring.spool_stroke * spool
    force.plot(100.0 * spool, straight, "--", color=COLOURS[3], label="constant spring")
    for label, valve, style in (("flow force", jets, "-"), ("constant spring", spring, "--")):
        draw_steps(reached, label, valve, style, COLOURS[0])
    for axes in (force, reached):
        axes.legend(frameon=False, fontsize=9)
    tidy(force, "spool position [%]", "flow force [N]")
    tidy(reached, "time [ms]", "spool position [%]")
    return figure
