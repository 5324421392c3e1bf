"""Figures of valve and table: steps, responses (6.10, 6.11), flow force, oil spring, effects, parameters (6.19 …)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from shake_ros.core.analysis.frequency_response import describing_function, fundamental
from shake_ros.core.effects import EFFECTS
from shake_ros.core.packing import record
from shake_ros.core.plant.linearisation import linearise, oil_column_frequency, operating_point
from shake_ros.core.plant.parameters import TableParameters
from shake_ros.core.plant.simulation import run
from shake_ros.core.quantities import Parameters
from shake_ros.core.valve import VALVES
from shake_ros.core.valve.ports import steady_force
from shake_ros.core.valve.response import linear_response, valve_response
from shake_ros.report.chart import BEFORE, COLOURS, GREY, name_decades, new_figure, tidy
from shake_ros.settings import find, load_table, load_variant, read_yaml
from shake_ros.thesis.sensitivity import (
    HIGHEST_HARMONIC,
    LOWEST_SHOWN,
    ROWS,
    SHOWN_PERIODS,
    ParameterStudy,
    value_label,
)

HARMONICS = 15  # of the figures of effects
LOWEST_OF_EFFECT = 3e-3  # [m/s²]
OUTPUT, UNITS = {"position_sensor_lag": 0}, {0: "position [m]", 2: "acceleration [m/s²]"}
PERIODS = 6
POINTS = 25


def settings() -> tuple[dict[str, Any], dict[str, Parameters], float, float]:
    """Content of config/figures/valve.yaml, the two valves, supply and tank pressure [Pa]."""
    content: dict[str, Any] = read_yaml(find("figures", "valve"))
    table = load_table(content["table"])
    detailed = load_variant("valve", content["valve"], VALVES)[1]
    valves: dict[str, Parameters] = {"two-stage": detailed, "second order": table.valve}
    return content, valves, table.supply.supply_pressure, table.supply.tank_pressure


def steps() -> Figure:
    """Figure 6.10: spool after steps of the command, two-stage valve and second-order model."""
    content, valves, supply, tank = settings()
    dt = content["sample_time"]
    t = np.arange(round(content["seconds"] / dt)) * dt
    figure = new_figure(8.0, 4.6)
    axes = figure.subplots()
    for (name, valve), colour, style in zip(valves.items(), COLOURS, ("-", "--"), strict=False):
        for i, size in enumerate(content["steps"]):
            spool = valve_response(valve, np.full(len(t), size), dt, supply, tank)
            axes.plot(1e3 * t, 100.0 * spool, style, color=colour, linewidth=1.5, label=name if i == 0 else None)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    tidy(axes, "time [ms]", "spool position [%]")
    return figure


def second_order_step() -> Figure:
    """Figure 6.11: spool of (6.7), (6.8) with the parameters of table 6.4 after a step of the command from 0 to 1."""
    content, valves, supply, tank = settings()
    dt = content["sample_time"]
    t = np.arange(round(content["seconds"] / dt)) * dt
    figure = new_figure(8.0, 4.0)
    axes = figure.subplots()
    spool = valve_response(valves["second order"], np.ones(len(t)), dt, supply, tank)
    axes.plot(1e3 * t, spool, color=COLOURS[0], linewidth=1.5)
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


def frequency_response() -> Figure:
    """Gain and phase of the spool: both models linearised at null, and the two-stage valve under larger sines."""
    content, valves, supply, tank = settings()
    frequencies = np.geomspace(content["lowest_frequency"], content["highest_frequency"], POINTS)
    curves = [
        (f"{name}, linearised", linear_response(valve, frequencies, supply, tank), style)
        for (name, valve), style in zip(valves.items(), ("-", "--"), strict=True)
    ]
    for amplitude in content["amplitudes"]:
        points = [
            sine_response(valves["two-stage"], amplitude, f, content["sample_time"], supply, tank) for f in frequencies
        ]
        curves.append((f"two-stage, {100.0 * amplitude:g} %", np.array(points), ":"))
    figure = new_figure(8.0, 6.0)
    gain, phase = figure.subplots(2, 1, sharex=True)
    for (label, response, style), colour in zip(curves, COLOURS, strict=False):
        gain.semilogx(frequencies, 20.0 * np.log10(np.abs(response)), style, color=colour, label=label)
        phase.semilogx(frequencies, np.degrees(np.unwrap(np.angle(response))), style, color=colour)
    gain.legend(frameon=False, fontsize=9, loc="lower left")
    tidy(gain, "", "gain [dB]")
    tidy(phase, "frequency [Hz]", "phase [°]")
    return figure


def flow_force() -> Figure:
    """Steady flow force over the spool at three load pressures, and the steps of figure 6.10 with it and with a spring.

    The spring is that of the valve without: force against the spool's way, and spool after steps of the command.
    """
    content, valves, supply, tank = settings()
    spring: Any = valves["two-stage"]
    jets: Any = load_variant("valve", content["with_flow_force"], VALVES)[1]
    p, middle = record("valve", VALVES, jets), 0.5 * (supply + tank)
    figure = new_figure(8.0, 6.0)
    force, steps = figure.subplots(2, 1)
    spool = np.linspace(-1.0, 1.0, 201)
    for load, colour in zip(content["load_pressures"], COLOURS, strict=False):
        ports = middle + 0.5 * load, middle - 0.5 * load, 0.0, 0.0
        drawn = [steady_force(p, x, ports, supply, tank) for x in spool]
        force.plot(100.0 * spool, drawn, color=colour, label=f"load pressure {1e-5 * load:g} bar")
    straight = spring.flow_force_stiffness * spring.spool_stroke * spool
    force.plot(100.0 * spool, straight, "--", color=COLOURS[3], label="constant spring")
    dt = content["sample_time"]
    t = np.arange(round(content["seconds"] / dt)) * dt
    for label, valve, style in (("flow force", jets, "-"), ("constant spring", spring, "--")):
        for i, size in enumerate(content["steps"]):
            reached = valve_response(valve, np.full(len(t), size), dt, supply, tank)
            steps.plot(1e3 * t, 100.0 * reached, style, color=COLOURS[0], label=label if i == 0 else None)
    for axes in (force, steps):
        axes.legend(frameon=False, fontsize=9)
    tidy(force, "spool position [%]", "flow force [N]")
    tidy(steps, "time [ms]", "spool position [%]")
    return figure


FREQUENCIES, PLACES = 33, 25
WITHIN = 0.75  # of the stroke
SAMPLE = 1e-3  # [s]


def linear_settings() -> tuple[dict[str, Any], TableParameters]:
    """Content of config/figures/linear.yaml, and its table."""
    content: dict[str, Any] = read_yaml(find("figures", "linear"))
    return content, load_table(content["table"])


def describing_functions() -> Figure:
    """Gain and phase of the velocity's fundamental over frequency for several amplitudes, beside the linearised table.

    The half sample by which a held command comes late is taken off. At rest the table has no linear form that a sine
    would show: dry friction holds it; so it is linearised about a steady motion.
    """
    content, table = linear_settings()
    frequencies = np.geomspace(content["lowest_frequency"], content["highest_frequency"], FREQUENCIES)
    found = describing_function(table, np.array(content["amplitudes"]), frequencies, sample_time=SAMPLE)
    held = np.exp(-1j * np.pi * frequencies * SAMPLE)
    fine = np.geomspace(frequencies[0], frequencies[-1], 400)
    moving = linearise(table, operating_point(table, 0.0, content["velocity"]))
    label = f"linearised at {1e3 * content['velocity']:g} mm/s"
    curves = [(label, fine, moving.response("velocity", fine), "--")]
    curves += [
        (f"amplitude {100.0 * amplitude:g} %", frequencies, row / held, "-")
        for amplitude, row in zip(found.amplitudes, found.response, strict=True)
    ]
    figure = new_figure(8.0, 6.0)
    gain, phase = figure.subplots(2, 1, sharex=True)
    for (label, axis, response, style), colour in zip(curves, COLOURS, strict=False):
        gain.loglog(axis, np.abs(response), style, color=colour, label=label)
        phase.semilogx(axis, np.degrees(np.unwrap(np.angle(response))), style, color=colour)
    gain.legend(frameon=False, fontsize=9, loc="lower left")
    for side in (gain.xaxis, gain.yaxis):
        name_decades(side)
    tidy(gain, "", "velocity per command [m/s]")
    tidy(phase, "frequency [Hz]", "phase [°]")
    return figure


def column_frequency(table: TableParameters, position: float, velocity: float) -> float:
    """Size of the oil column's pair among the poles of the table linearised at a position and steady velocity [Hz]."""
    poles = linearise(table, operating_point(table, position, velocity)).poles()
    pairs = poles[np.abs(poles.imag) > 1e-3 * np.abs(poles)]
    return float(np.abs(pairs[0]) / (2.0 * np.pi))


def oil_spring() -> Figure:
    """Frequency of the oil column along the stroke: closed form (2.25), (2.36), and poles of the linearised table."""
    content, table = linear_settings()
    half = 0.5 * WITHIN * table.value("body.stroke")
    places = np.linspace(-half, half, PLACES)
    figure = new_figure(8.0, 4.2)
    axes = figure.subplots()
    for mass, colour in zip(content["specimens"], COLOURS, strict=False):
        loaded = table.with_values({"body.specimen_mass": mass})
        closed = [oil_column_frequency(loaded, x) / (2.0 * np.pi) for x in places]
        poles = [column_frequency(loaded, x, content["velocity"]) for x in places]
        axes.plot(1e3 * places, closed, color=colour, label=f"closed form, {mass:g} kg")
        axes.plot(1e3 * places, poles, "o", color=colour, markersize=4, label=f"poles, {mass:g} kg")
    axes.legend(frameon=False, fontsize=9, ncols=3)
    tidy(axes, "position [mm]", "frequency [Hz]")
    return figure


def motion_figure(study: ParameterStudy, frequency: float) -> Figure:
    """Figures 6.19, 6.21, 6.23: position, velocity and acceleration over the last periods."""
    figure = new_figure(9.0, 7.0)
    panels = figure.subplots(3, 1, sharex=True)
    shown = round(SHOWN_PERIODS / frequency / study.sample_time)
    t = np.arange(len(study.commands))[-shown:] * study.sample_time
    for axes, (name, column) in zip(np.ravel(panels), ROWS, strict=True):
        for i, value in enumerate(study.values):
            run = study.motion[i, -shown:, column]
            run = run - run.mean() if column == 0 else run
            axes.plot(t, run, color=COLOURS[i % len(COLOURS)], linewidth=1.4, label=value_label(study, float(value)))
        tidy(axes, "time [s]" if column == ROWS[-1][1] else "", name)
    np.ravel(panels)[0].legend(
        frameon=False, fontsize=9, ncols=len(study.values), loc="lower right", bbox_to_anchor=(1.0, 1.0)
    )
    return figure


def spectrum_figure(study: ParameterStudy, frequency: float, samples: int) -> Figure:
    """Figures 6.20, 6.22, 6.24: amplitudes of the acceleration over frequency."""
    figure = new_figure(9.0, 4.0)
    axes = figure.subplots()
    frequencies, amplitudes = study.spectrum(samples)
    harmonics = np.arange(1, HIGHEST_HARMONIC + 1)
    places = [int(np.argmin(np.abs(frequencies - k * frequency))) for k in harmonics]
    width = 0.8 / len(study.values)
    for i, value in enumerate(study.values):
        offset = (i - 0.5 * (len(study.values) - 1)) * width
        heights = amplitudes[i, places]
        axes.bar(
            harmonics + offset, heights, width, color=COLOURS[i % len(COLOURS)], label=value_label(study, float(value))
        )
    axes.set_xticks(harmonics, [f"{k * frequency:g}" for k in harmonics])
    axes.set_yscale("log")
    axes.set_ylim(bottom=LOWEST_SHOWN)
    axes.legend(frameon=False, fontsize=9)
    tidy(axes, "frequency [Hz]", "acceleration [m/s²]")
    return figure


def strength(name: str) -> dict[str, float]:
    """Parameters at which an effect is shown: of config/figures/effects.yaml, else its first trial of the search."""
    own = read_yaml(find("figures", "effects"))["strengths"]
    chosen: dict[str, float] = own[name] if name in own else read_yaml(find("discovery", "effects"))[name]["trials"][0]
    return chosen


def responses(name: str, frequency: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], shape (n,), and the declared and the extended table's output over the last periods, both (n,)."""
    content: dict[str, Any] = read_yaml(find("figures", "effects"))
    declared = load_table(content["table"])
    extended = declared.with_values({f"effects.{name}.{field}": value for field, value in strength(name).items()})
    dt = content["sample_time"]
    window = round(round(4.0 * frequency / 2.0) / frequency / dt)  # whole periods, about two seconds
    t = np.arange(round(content["settling"] / dt) + window) * dt
    command = content["amplitude"] * np.sin(2.0 * np.pi * frequency * t)
    column = OUTPUT.get(name, 2)
    before, after = (run(table, command, dt)[-window:, column] for table in (declared, extended))
    return t[-window:], before, after


def effect_figure(name: str) -> Figure:
    """Two periods in time and the harmonics, without and with the effect, at both frequencies."""
    content: dict[str, Any] = read_yaml(find("figures", "effects"))
    figure = new_figure(11.0, 5.6)
    values = ", ".join(f"{field} = {value:g}" for field, value in strength(name).items())
    figure.suptitle(f"{name.replace('_', ' ')}  ({EFFECTS[name].place}; {values})", fontsize=11)
    panels = figure.subplots(2, 2)
    for (left, right), frequency in zip(panels, content["frequencies"], strict=True):
        t, before, after = responses(name, frequency)
        shown = t < t[0] + 2.0 / frequency
        harmonics = np.arange(1, HARMONICS + 1)
        places = harmonics * round(frequency * len(t) * content["sample_time"])
        for i, (signal, label) in enumerate(((before, "declared"), (after, "with the effect"))):
            colour = GREY if i == 0 else BEFORE
            left.plot(t[shown], signal[shown], color=colour, linewidth=1.4, label=label)
            amplitudes = 2.0 / len(signal) * np.abs(np.fft.rfft(signal))[places]
            right.bar(harmonics + 0.4 * i - 0.2, amplitudes, 0.4, color=colour)
        right.set_yscale("log")
        right.set_xticks(harmonics)
        unit = UNITS[OUTPUT.get(name, 2)]
        if name not in OUTPUT:
            right.set_ylim(bottom=LOWEST_OF_EFFECT)
        tidy(left, "time [s]", unit, f"{frequency:g} Hz")
        tidy(right, "harmonic", unit)
    panels[0][0].legend(frameon=False, fontsize=9, loc="upper right")
    return figure
