"""Thesis 6.3.6: what the soft zone of (6.18)–(6.20) adds to the IFAS modulus; figures 6.29 to 6.35, table 6.10.

Work that the oil takes up around a closed cycle of both chamber pressures, the piston held in its place, is

    W = ∮ P_A dV_A + P_B dV_B,  dV = C dP,  C = diag(V/E) + c [[1, −r], [−r, r²]]

with dV the oil that flows in, c the compliance of an exchanged volume. Zero for any law whose E is a function of the
chamber's own pressure, and for the exchanged volume. With h(P_L) of (6.18), (6.19) the integrand has the curl
(V/E)(P_A + P_B) d(1/h)/dP_L, so one way round it takes up work and the other way it makes it. Verified against the
plant's own rates and the double integral of the curl.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.progress import Progress
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.measured.runs import PRINTED, printed_tables
from shake_ros.packing import record
from shake_ros.physics.effects.hydraulics import factor
from shake_ros.physics.friction import FRICTIONS, steady_force
from shake_ros.physics.plant.cylinder import rest_pressures, volumes
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.physics.plant.right_hand_side import chamber_moduli, exchange_compliance
from shake_ros.physics.plant.simulation import run as simulated
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.settings import load_table
from shake_ros.thesis.reproduce import (
    Claim,
    ExperimentReport,
    Rows,
    asked_in,
    free_of,
    motions,
    moved,
    recorded,
    sine,
    words,
)

STEPS = 400  # of each side of the cycle, by the midpoint rule


def compliance(table: TableParameters, pressure_a: float, pressure_b: float) -> NDArray[np.float64]:
    """C of both chambers at mid-stroke: oil that flows in per pressure, shape (2, 2) [m³/Pa]."""
    p = FULL_LAYOUT.alone(table.vector())[0]
    return _compliance(p, table, pressure_a, pressure_b)


def _compliance(p: object, table: TableParameters, pressure_a: float, pressure_b: float) -> NDArray[np.float64]:
    volume, ratio = volumes(table), table.body.area_ratio
    e_a, e_b = chamber_moduli(p, pressure_a, pressure_b)
    passed = 0.0
    if table.value("effects.soft_zone.depth") > 0.0 and table.value("effects.soft_zone.exchange") > 0.0:
        passed = float(exchange_compliance(p, pressure_a, pressure_b))
    return np.diag([volume.a / e_a, volume.b / e_b]) + passed * np.array([[1.0, -ratio], [-ratio, ratio**2]])


def work_of_cycle(table: TableParameters, swing: float, backwards: bool = False) -> float:
    """Work that is left behind by one cycle [J].

    From the pressures of rest P_A rises by `swing` [Pa], then P_B, then both fall together; `backwards` goes round the
    other way.
    """
    p = FULL_LAYOUT.alone(table.vector())[0]
    rest = np.array(rest_pressures(table.supply.supply_pressure, table.supply.tank_pressure, table.body.area_ratio))
    corners = rest + swing * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
    if backwards:
        corners = corners[::-1]
    work = 0.0
    for start, end in zip(corners[:-1], corners[1:], strict=True):
        step = (end - start) / STEPS
        for k in range(STEPS):
            pressures = start + (k + 0.5) * step
            work += float(pressures @ _compliance(p, table, *pressures) @ step)
    return work


KEYS = ("plant", "printed", "sample_time", "seconds", "runs", "fitted_to", "free", "same_within", "cycles")
MODIFIED, IFAS, AGAIN = "modified IFAS", "IFAS as printed", "IFAS fitted again"
SHOWN = 1.0  # end of a run that a figure shows [s]
EXTENT = 40e5  # load pressure to which figure 6.31 is drawn [Pa]


def run(progress: Progress, settings: str = "bulk_modulus") -> ExperimentReport:
    """All runs under the three models."""
    asked = asked_in(settings, KEYS)
    plant = load_table(asked["plant"])
    printed = printed_tables(load_table("bergamo"))[PRINTED[asked["printed"]]]
    progress("table 6.10", 0.0)
    again = _fitted(asked, plant, printed)
    errors, drawn = dict[str, dict[str, Mapping[str, float]]](), list[Chart]()
    for i, (number, wave) in enumerate(asked["runs"].items()):
        progress(f"figure {number}", 0.5 + 0.1 * i)
        models = {name: _loaded(t, wave) for name, t in ((MODIFIED, plant), (IFAS, printed), (AGAIN, again))}
        record = _record(number, models[MODIFIED], wave, asked)
        problem = RecordingProblem([record])
        errors[number] = {name: problem.errors(models[name].vector())[number] for name in (IFAS, AGAIN)}
        drawn.append(_motions(number, wave, record, models))
    number, wave = next(iter(asked["runs"].items()))
    drawn[1:1] = [_figure_6_30(number, wave, plant, asked), _figure_6_31(plant)]
    return ExperimentReport(
        title="The bulk modulus of the thesis",
        lead="Thesis 6.3.6: (6.18) to (6.20) against the plain IFAS modulus (2.32), both with the parameters of table "
        "6.9.",
        claims=_claims(asked, errors),
        tables=[_table(asked, errors), _parameters(asked, {IFAS: printed, AGAIN: again}), _work(asked, plant)],
        charts=drawn,
        remarks=(
            "The recordings are not published, so the plant is the model with the soft zone: what can be compared is "
            "where the plain law differs from it, not which of them is nearer to the real table. `measured_runs` "
            "compares both with the measured harmonics of tables 6.1 and 6.2.",
            "I of (4.1) is printed without the number and unit of its samples; relative errors stand beside it.",
            f"The plain law is fitted to {', '.join(asked['fitted_to'])} with {', '.join(asked['free'])} free.",
            "(6.18), (6.19) let E of a chamber depend on the pressure of the other, so a closed cycle of the pressures "
            "destroys energy, or creates it the other way round. The same softness as a volume that the chambers "
            "exchange (`effects.soft_zone.exchange`) conserves energy and oil.",
            "The text gives the pulse of figure 6.36 as a picture only, so its row of table 6.10 is left out; so are "
            "the first parts of all runs that the figures do not show.",
        ),
    )


def _commands(wave: Mapping[str, Any], asked: Mapping[str, Any]) -> np.ndarray:
    """The input of a run; (6.21) doubles its amplitude on the way."""
    dt, seconds = asked["sample_time"], wave.get("seconds", asked["seconds"])
    commands = sine(wave, seconds, dt)
    if "doubled_at" in wave:
        commands[round(wave["doubled_at"] / dt) :] *= 2.0  # (6.21)
    return commands


def _loaded(table: TableParameters, wave: Mapping[str, Any]) -> TableParameters:
    return table.with_values({"body.specimen_mass": wave["mass"]})


def _record(number: str, table: TableParameters, wave: Mapping[str, Any], asked: Mapping[str, Any]) -> Record:
    return recorded(number, table, _commands(wave, asked), asked["sample_time"])


def _fitted(asked: Mapping[str, Any], plant: TableParameters, printed: TableParameters) -> TableParameters:
    """The plain law fitted to the plant's runs."""
    waves = {number: asked["runs"][number] for number in asked["fitted_to"]}
    (mass,) = {wave["mass"] for wave in waves.values()}
    records = [_record(number, _loaded(plant, wave), wave, asked) for number, wave in waves.items()]
    free = free_of(printed.with_values({"body.specimen_mass": mass}), asked["free"])
    return free.table(fit(RecordingProblem(records), free, free.start(), evaluations=30).x)


def _table(asked: Mapping[str, Any], errors: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Rows:
    head = ["figure", "input", "mass [kg]", "I, modified", "I, IFAS"]
    head += [f"{channel}, {name}" for name in (IFAS, AGAIN) for channel in ("velocity", "acceleration")]
    rows = [
        [number, _words(wave), f"{wave['mass']:g}", f"{wave['modified']:g}", f"{wave['ifas']:g}"]
        + [f"{100.0 * v:.1f} %" for name in (IFAS, AGAIN) for v in errors[number][name].values()]
        for number, wave in asked["runs"].items()
    ]
    return Rows(
        "Table 6.10: the printed cost, and the difference of the plain law from the modified one here", head, rows
    )


def _words(wave: Mapping[str, Any]) -> str:
    return words(wave) + (f", doubled at {wave['doubled_at']:g} s" if "doubled_at" in wave else "")


def _parameters(asked: Mapping[str, Any], models: Mapping[str, TableParameters]) -> Rows:
    names = [*asked["free"], "effects.pressure_dependent_bulk_modulus.slope"]
    rows = [
        [f"{name} [{next(iter(models.values())).fields[name].metadata['unit']}]"]
        + [f"{table.value(name):.4g}" for table in models.values()]
        for name in names
    ]
    return Rows("Parameters of the plain law", ("parameter", *models), rows)


def _claims(asked: Mapping[str, Any], errors: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[Claim]:
    felt = {name: {n: e[name]["acceleration"] for n, e in errors.items()} for name in (IFAS, AGAIN)}
    gaps = {number: wave["ifas"] - wave["modified"] for number, wave in asked["runs"].items()}

    def shares(of: Mapping[str, float]) -> str:
        return ", ".join(f"{number} {100.0 * v:.0f} %" for number, v in of.items())

    sines, found = asked["fitted_to"], []
    for name, values in felt.items():
        close = values["6.33"] <= asked["same_within"]
        others = {n: v for n, v in values.items() if n != "6.33"}
        found += [
            Claim("6.3.6, 6.33", f"both laws almost the same under {_words(asked['runs']['6.33'])} ({name})",
                  "figure only", shares({"6.33": values["6.33"]}), close),
            Claim("6.3.6, 6.10", f"without the soft zone the acceleration is not simulated at 2, 5 and 8 Hz ({name})",
                  "I " + ", ".join(f"{n} +{gaps[n]:.0f}" for n in others), shares(others),
                  min(others.values()) > asked["same_within"]),
            Claim("6.3.6, 6.10", f"of the sines with 200 kg, 8 Hz distinguishes the laws best, 14 Hz least ({name})",
                  ", ".join(f"{n} +{gaps[n]:.0f}" for n in sines), shares({n: values[n] for n in sines}),
                  sorted(sines, key=values.__getitem__) == sorted(sines, key=gaps.__getitem__)),
        ]  # fmt: skip
    text = "the modified law's cost is the lower one under every input"
    found.append(Claim("6.3.6, 6.10", text, "6 rows", "–", None, "It needs the recordings, which are not published."))
    return found


def _work(asked: Mapping[str, Any], plant: TableParameters) -> Rows:
    """Work of a closed cycle with both laws of the soft zone, on table 6.9 and on the constant modulus of table 6.8."""
    depth = plant.value("effects.soft_zone.depth")
    laws = {
        "table 6.9": plant,
        "table 6.8 with the zone": load_table("bergamo").with_values({"effects.soft_zone.depth": depth}),
    }
    exchanged = {f"{n}, exchanged": t.with_values({"effects.soft_zone.exchange": 1.0}) for n, t in laws.items()}
    rows = [
        [name] + [f"{work_of_cycle(t, s * 1e5, back):+.1f}" for s in asked["cycles"] for back in (False, True)]
        for name, t in (laws | exchanged).items()
    ]
    head = ["law"] + [f"{s:g} bar{back}" for s in asked["cycles"] for back in ("", ", backwards")]
    title = "Work taken up [J] while P_A rises from rest by so much, then P_B, then both fall together"
    return Rows(title, head, rows)


def _motions(number: str, wave: Mapping[str, Any], record: Record, models: Mapping[str, TableParameters]) -> Chart:
    dt, count = record.sample_time, len(record.commands)
    end = round((wave["doubled_at"] + 1.2) / dt) if "doubled_at" in wave else count
    span = slice(end - round((2.4 if "doubled_at" in wave else SHOWN) / dt), end)
    runs = {name: moved(models[name], record) for name in (IFAS, AGAIN)}
    caption = f"As figure {number}: {_words(wave)} with {wave['mass']:g} kg"
    return motions(f"figure_{number}", MODIFIED, record, runs, span, caption)


def _figure_6_30(number: str, wave: Mapping[str, Any], plant: TableParameters, asked: Mapping[str, Any]) -> Chart:
    """E of chamber A and friction over the end of a run."""
    table, dt = _loaded(plant, wave), asked["sample_time"]
    out = simulated(table, _commands(wave, asked), dt)[-round(SHOWN / dt) :]
    modulus = effective_modulus(table, out[:, 3], out[:, 4])
    law = record("friction", FRICTIONS, table.friction)
    friction = [float(steady_force(law, v)) for v in out[:, 1]]
    time = np.arange(len(out)) * dt
    panels = (
        Panel("E of chamber A [Pa]", time, (ChartSeries("(6.18)", modulus, "after"),)),
        Panel("friction [N]", time, (ChartSeries("(6.10)", np.array(friction), "before"),)),
    )
    return Chart("figure_6.30", "time [s]", panels, f"As figure 6.30: under the input of figure {number}")


def effective_modulus(table: TableParameters, pressure_a: np.ndarray, pressure_b: np.ndarray) -> np.ndarray:
    """E_A of (6.18) at pressures of shape (n,) [Pa]."""
    p = FULL_LAYOUT.alone(table.vector())[0]
    return np.array([chamber_moduli(p, a, b)[0] for a, b in zip(pressure_a, pressure_b, strict=True)])


def _figure_6_31(plant: TableParameters) -> Chart:
    """E over the load pressure about the pressures of rest."""
    load = np.linspace(-EXTENT, EXTENT, 161)
    middle = 0.5 * (plant.supply.supply_pressure + plant.supply.tank_pressure)
    pressures = middle + 0.5 * load, middle - 0.5 * load
    without = plant.without(["soft_zone"])
    shape = [plant.value(f"effects.soft_zone.{name}") for name in ("depth", "threshold", "sharpness")]
    zone = [float(factor(pressure, *shape)) for pressure in load]
    panels = (
        Panel(
            "E of chamber A [Pa]",
            load / 1e5,
            (
                ChartSeries("modified IFAS (6.18)", effective_modulus(plant, *pressures), "after"),
                ChartSeries("its liquid and air alone", effective_modulus(without, *pressures), "before"),
            ),
        ),
        Panel("h of (6.20) [-]", load / 1e5, (ChartSeries("h/λ_1", np.array(zone), "after"),)),
    )
    return Chart(
        "figure_6.31", "load pressure P_A − P_B [bar]", panels, "As figure 6.31: the modulus over load pressure"
    )
