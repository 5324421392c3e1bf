"""The loops that `tune` and `compare` run, from config/compare and its configurations, on perturbed tables as well.

A perturbed table has its parameters multiplied by seeded factors, and a dead time of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.closed_loop import Loop
from shake_ros.control.laws import CONTROLLERS
from shake_ros.control.laws.law import LawParameters
from shake_ros.control.laws.runner import Controller
from shake_ros.control.metrics import Judged, spectrum_of
from shake_ros.control.observer import OBSERVERS
from shake_ros.control.observer.law import ObserverParameters
from shake_ros.control.observer.runner import Observer
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError, quantity, strict_keys, unknown_name
from shake_ros.recordings.reference_file import Reference, load_reference, make_program
from shake_ros.settings import find, load_table, load_variant, read_yaml

DEAD_TIME = "effects.command_delay.delay"


@dataclass(frozen=True)
class Spread(Parameters):
    """Bounds of the factors, drawn evenly between them; those of one group share a draw."""

    bulk_modulus_low: float = quantity("-", "least factor of the bulk modulus", low=0.05, high=1.0)
    bulk_modulus_high: float = quantity("-", "largest factor of the bulk modulus", low=1.0, high=20.0)
    friction_low: float = quantity("-", "least factor of all friction levels", low=0.0, high=1.0)
    friction_high: float = quantity("-", "largest factor of all friction levels", low=1.0, high=100.0)
    supply_low: float = quantity("-", "least factor of the supply pressure", low=0.05, high=1.0)
    supply_high: float = quantity("-", "largest factor of the supply pressure", low=1.0, high=4.0)
    leakage_low: float = quantity("-", "least factor of both leakages", low=0.0, high=1.0)
    leakage_high: float = quantity("-", "largest factor of both leakages", low=1.0, high=100.0)
    delay_low: float = quantity("s", "least dead time of the command", low=0.0, high=0.05)
    delay_high: float = quantity("s", "largest dead time of the command", low=0.0, high=0.05)


GROUPS: Mapping[str, tuple[str, ...]] = {
    "bulk_modulus": ("bulk_modulus.modulus",),  # or what another law has in its place, `BulkModulusLaw.scaled`
    "friction": ("friction.coulomb_level", "friction.stribeck_rise", "friction.viscous"),
    "supply": ("supply.supply_pressure",),
    "leakage": ("leakage.internal", "leakage.external"),
}


def perturbed(table: TableParameters, spread: Spread, count: int, seed: int) -> list[TableParameters]:
    """Tables with factors of the same seed; the first k of n are those that a call for k gives.

    Raises
    ------
    ShakeError : delay_low above delay_high, or a factor that takes a parameter out of its bounds.
    """
    if spread.delay_low > spread.delay_high:
        raise ShakeError(f"spread: delay_low = {spread.delay_low:g} is above delay_high = {spread.delay_high:g} s")
    drawn = np.random.Generator(np.random.Philox(key=seed)).uniform(size=(count, len(GROUPS) + 1))
    result = []
    for row in drawn:
        values = {}
        for share, (group, names) in zip(row, GROUPS.items(), strict=False):
            low, high = getattr(spread, f"{group}_low"), getattr(spread, f"{group}_high")
            factor = low + (high - low) * float(share)
            if group == "bulk_modulus":
                values.update({f"{group}.{name}": v for name, v in table.bulk_modulus.scaled(factor).items()})
            else:
                values.update({name: table.value(name) * factor for name in names})
        values[DEAD_TIME] = spread.delay_low + (spread.delay_high - spread.delay_low) * float(row[-1])
        result.append(table.with_values(values))
    return result


def _carried(parameters: Parameters, model: TableParameters | None) -> TableParameters | None:
    """The table that a configuration names, or the one in its place."""
    named = str(getattr(parameters, "model", ""))
    return model if model is not None or not named else load_table(named)


def load_controller(name: str, sample_time: float, model: TableParameters | None = None) -> Controller:
    """The controller of a configuration, with a model in place of the one that it names where one is given."""
    parameters: LawParameters
    kind, parameters = load_variant("controller", name, CONTROLLERS)
    return Controller(kind, parameters, sample_time, _carried(parameters, model))


def load_observer(name: str, sample_time: float, model: TableParameters | None = None) -> Observer:
    """The observer of a configuration, with a model in place of the one that it names where one is given."""
    parameters: ObserverParameters
    kind, parameters = load_variant("observer", name, OBSERVERS)
    return Observer(kind, parameters, sample_time, _carried(parameters, model))


Array = NDArray[np.float64]
MODELS = ("none", "load", "fixed")
MASS = "body.specimen_mass"


def strict(content: Any, keys: Sequence[str], where: str) -> dict[str, Any]:
    """A mapping with exactly these keys; anything else is an error that names the file."""
    return dict(strict_keys(content, keys, where, keys, kind="key"))


@dataclass(frozen=True)
class Course:
    """A reference as it is run: its samples (n, 3) with a rest behind, and the part that counts."""

    name: str
    states: Array
    part: Judged


@dataclass(frozen=True)
class Combination:
    """A line of a comparison: configurations of controller and observer, and the model they carry."""

    label: str
    controller: str
    observer: str
    model: str


@dataclass
class Setup:
    """The setup of a comparison: tables by load, perturbed ones, references, and laws and observers for them."""

    settings: Mapping[str, Any]
    where: str
    _feedforwards: dict[tuple[Any, ...], tuple[Array, Array]] = field(default_factory=dict)

    @property
    def sample_time(self) -> float:
        """Of plant, observer and controller [s]."""
        return float(self.settings["sample_time"])

    def table(self, load: float) -> TableParameters:
        """The plant under a load [kg]."""
        return load_table(self.settings["table"]).with_values({**self.settings["values"], MASS: load})

    def model(self, load: float) -> TableParameters:
        """What identification finds of the plant under a load [kg]."""
        return self.table(load).with_values(self.settings["model_values"])

    def perturbed(self, count: int, seed: int | None = None) -> list[tuple[float, TableParameters]]:
        """Loads [kg], in turn, and perturbed tables under them; of the settings' seed, or of another."""
        given = strict(self.settings["perturbed"], ("count", "seed", "spread"), f"{self.where}: perturbed")
        spread = Spread.from_mapping(given["spread"], f"{self.where}: perturbed: spread")
        loads = [self.settings["loads"][i % len(self.settings["loads"])] for i in range(count)]
        drawn = int(given["seed"]) if seed is None else seed
        return [(load, perturbed(self.table(load), spread, i + 1, drawn)[i]) for i, load in enumerate(loads)]

    def course(self, reference: Reference, name: str) -> Course:
        """A reference ready to be run."""
        dt, shaping = self.sample_time, reference.shaping
        program = make_program(reference, dt)
        rest = round(self.settings["rest"] / dt)
        first = round(shaping.soft_start / dt)
        last = program.length - round(shaping.soft_stop / dt)
        states = program.samples(0, program.length + rest)
        frequency = float(getattr(reference.parameters, "frequency", 0.0)) if reference.kind == "sine" else 0.0
        spectrum = spectrum_of(states[first:last, 2], dt)
        return Course(name, states, Judged(first, last, program.length + rest // 2, frequency, spectrum))

    def courses(self, names: Sequence[str]) -> list[Course]:
        """References of config/reference."""
        return [self.course(load_reference(name), Path(name).stem) for name in names]

    def records(self, paths: Sequence[str]) -> list[Course]:
        """Accelerograms, scaled as the configuration's `record_reference` says."""
        base = load_reference(self.settings["record_reference"])
        if base.kind != "earthquake":
            raise ShakeError(f"{self.where}: record_reference '{self.settings['record_reference']}' is no earthquake")
        return [self.course(base._replace(parameters=base.parameters.replace(record=p)), Path(p).stem) for p in paths]

    def loop(self, entry: Combination, course: Course, load: float, table: TableParameters, delay: int) -> Loop:
        """An entry on a table."""
        model = self.model(self.settings["model_load"] if entry.model == "fixed" else load)
        carried = model if entry.model != "none" else None
        law = Controller(*load_variant("controller", entry.controller, CONTROLLERS), self.sample_time, carried)
        return Loop(
            table,
            load_observer(entry.observer, self.sample_time, model),
            law,
            course.states,
            self._feedforward(law, course, float(model.value(MASS))),
            seed=int(self.settings["seed"]),
            delay=delay,
        )

    def _feedforward(self, law: Controller, course: Course, load: float) -> tuple[Array, Array] | None:
        """The virtual table's run along a course, computed once for all laws that share it."""
        if law.virtual is None:
            return None
        key = (course.name, len(course.states), load, tuple(law.virtual.settings))
        if key not in self._feedforwards:
            self._feedforwards[key] = law.virtual.follow(course.states)
        return self._feedforwards[key]

    def words(self) -> str:
        """The plant in a sentence."""
        s, sensors = self.settings, self.table(self.settings["model_load"]).sensors
        changed = ", ".join(f"{k} = {v:g}" for k, v in s["values"].items())
        return (
            f"Table {s['table']}{' with ' if changed else ''}{changed}; "
            f"{1e-3 / s['sample_time']:g} kHz; position with {1e6 * sensors.position_noise:g} µm of noise and "
            f"{sensors.position_bits} bits over {1e3 * sensors.position_range:g} mm; commands {s['delay']} sample late."
        )


KEYS = (
    "table", "values", "model_values", "sample_time", "delay", "seed", "loads", "model_load", "references",
    "record_reference", "figure_reference", "figure_load", "rest", "perturbed", "quick", "entries",
)  # fmt: skip


def load_setup(name: str, changes: Mapping[str, Any] | None = None) -> Setup:
    """The plant of config/compare/<name>.yaml, or of a YAML file, with `changes` of its keys."""
    path = find("compare", name)
    return Setup(strict({**read_yaml(path), **(changes or {})}, KEYS, str(path)), str(path))


def combinations(setup: Setup) -> list[Combination]:
    """The lines of a comparison; each configuration is read once, so that a wrong one ends the command at once."""
    result = []
    for label, content in setup.settings["entries"].items():
        where = f"{setup.where}: entries: {label}"
        entry = Combination(str(label), **strict(content, ("controller", "observer", "model"), where))
        if entry.model not in MODELS:
            raise unknown_name("model", entry.model, MODELS, where)
        load_variant("controller", entry.controller, CONTROLLERS)
        load_variant("observer", entry.observer, OBSERVERS)
        result.append(entry)
    return result
