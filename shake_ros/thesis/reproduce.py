"""`reproduce`: the experiments of the thesis's chapter 6 run again, each claim beside what is found here; its pages."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.declared import free_parameters
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import unknown_name
from shake_ros.report.chart import Array, Chart, ChartSeries, Panel
from shake_ros.report.page import Page, write_page
from shake_ros.report.result_table import ResultTable, aligned
from shake_ros.result_folder import new_folder, write_json
from shake_ros.settings import find, load_content, read_yaml


class Claim(NamedTuple):
    """A statement of the thesis beside what is found here; `holds` is None where it cannot be decided."""

    source: str
    statement: str
    printed: str
    found: str
    holds: bool | None
    remark: str = ""

    @property
    def verdict(self) -> str:
        """In a word.

        >>> Claim("6.3.4", "…", "–", "61 %", True).verdict
        'holds'
        """
        return "cannot be decided" if self.holds is None else "holds" if self.holds else "does not hold"


class Rows(NamedTuple):
    """A table with its title."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class ExperimentReport:
    """One page of the reproduction."""

    title: str  # of the page
    lead: str  # in a sentence
    claims: Sequence[Claim]  # of the thesis
    # tables, charts: of this run
    tables: Sequence[Rows] = ()
    charts: Sequence[Chart] = ()
    remarks: Sequence[str] = ()  # what was assumed and what explains a difference


def difference(printed: float, found: float) -> str:
    """How far a value lies from the printed one, in per cent of that.

    >>> difference(2.0, 2.5), difference(0.0, 1.0)
    ('+25.0 %', '–')
    """
    return f"{100.0 * (found / printed - 1.0):+.1f} %" if printed else "–"


def asked_in(name: str, keys: Sequence[str]) -> dict[str, Any]:
    """Content of config/reproduce/NAME.yaml, or of another file; missing and unknown keys are errors."""
    return load_content("reproduce", name, keys)[0]


def free_of(table: TableParameters, names: Sequence[str]) -> FreeParameters:
    """A table with these parameters free."""
    known = {f.name: f for f in free_parameters()}
    return FreeParameters(table, [known[name] for name in names])


def sine(wave: Mapping[str, Any], seconds: float, sample_time: float) -> np.ndarray:
    """amplitude · sin(2π frequency t), shape (n,) [-].

    >>> sine({"amplitude": 0.5, "frequency": 1.0}, 1.0, 0.25).round(6).tolist()
    [0.0, 0.5, 0.0, -0.5]
    """
    time = np.arange(round(seconds / sample_time)) * sample_time
    return np.asarray(wave["amplitude"] * np.sin(2.0 * np.pi * wave["frequency"] * time))


def recorded(name: str, table: TableParameters, commands: np.ndarray, sample_time: float) -> Record:
    """Position and acceleration of a table's free run from mid-stroke, without noise."""
    out = run(table, commands, sample_time)
    return Record(name, sample_time, commands, out[:, 0], out[:, 2])


def noisy(record: Record, table: TableParameters, rng: np.random.Generator) -> Record:
    """The recording with the noise of the table's sensors."""
    assert record.acceleration is not None
    noise = rng.standard_normal((2, len(record.commands)))
    position = record.position + table.sensors.position_noise * noise[0]
    felt = record.acceleration + table.sensors.acceleration_noise * noise[1]
    return Record(record.name, record.sample_time, record.commands, position, felt)


def words(wave: Mapping[str, Any]) -> str:
    """An input in the thesis's notation.

    >>> words({"amplitude": 0.5, "frequency": 3.0})
    '0.5 sin(2π·3t)'
    """
    return f"{wave['amplitude']:g} sin(2π·{wave['frequency']:g}t)"


class ThesisExperiment(NamedTuple):
    """The module of this folder whose `run` gives the report, and a line about the experiment."""

    module: str
    line: str


EXPERIMENTS: dict[str, ThesisExperiment] = {
    "sensitivity": ThesisExperiment("sensitivity", "6.3.4, what θ_5, θ_6 and θ_7 do"),
    "reduced_model": ThesisExperiment("reduced_model", "6.3.7, 6.4.1, (6.36) over frequency"),
    "parameters": ThesisExperiment("parameters", "6.3.3, 6.3.4, tables 6.5 to 6.8"),
    "neural_schedule": ThesisExperiment("schedule", "6.3.5, parameters scheduled by a neural network"),
    "bulk_modulus": ThesisExperiment("bulk_modulus", "6.3.6, table 6.10, the soft zone"),
    "controllers": ThesisExperiment("controllers", "6.4.2–6.4.5, the three controllers"),
}


INDEX = "index.html"
HEAD = ("section", "the thesis says", "printed", "here", "verdict")


def claim_rows(claims: Sequence[Claim]) -> list[list[str]]:
    """A row for each claim."""
    return [[*c[:4], c.verdict] for c in claims]


def experiment_page(experiment: ExperimentReport) -> Page:
    """The page of one experiment."""
    page = Page(experiment.title, experiment.lead)
    page.link("all claims of the chapter", INDEX)
    page.heading("What the thesis says")
    page.table(HEAD, claim_rows(experiment.claims))
    for claim in experiment.claims:
        if claim.remark:
            page.paragraph(f"{claim.statement}: {claim.remark}")
    if experiment.remarks:
        page.heading("Assumptions and remarks")
    for remark in experiment.remarks:
        page.paragraph(remark)
    for title, head, rows in experiment.tables:
        page.heading(title)
        page.table(head, rows)
    if experiment.charts:
        page.heading("Figures")
    for chart in experiment.charts:
        page.chart(chart)
    return page


CHANNELS = {"velocity": "m/s", "acceleration": "m/s²"}
RUN_COLOURS = ("measured", "before", "after", "c3")


def moved(table: TableParameters, record: Record) -> tuple[Array, Array]:
    """Velocity [m/s] and acceleration [m/s²] of a table under a recording's commands, each (n,)."""
    own = recorded("", table, record.commands, record.sample_time)
    assert own.acceleration is not None
    return own.velocity, own.acceleration


def motions(
    name: str, truth: str, record: Record, runs: Mapping[str, tuple[Array, Array]], span: slice, caption: str
) -> Chart:
    """Velocity above, acceleration below, over a part of a recording.

    Parameters
    ----------
    name, caption : of the chart.
    truth, record : what the others should be, and its name.
    runs : velocity [m/s] and acceleration [m/s²], each (n,), by name.
    span : the samples that are drawn.
    """
    assert record.acceleration is not None
    time = np.arange(len(record.commands), dtype=np.float64)[span] * record.sample_time
    drawn = {truth: (record.velocity, record.acceleration), **runs}
    panels = [
        Panel(
            f"{channel} [{unit}]",
            time,
            tuple(
                ChartSeries(title, run[k][span], colour, width=2.0 if colour == "measured" else 1.2)
                for (title, run), colour in zip(drawn.items(), RUN_COLOURS, strict=False)
            ),
        )
        for k, (channel, unit) in enumerate(CHANNELS.items())
    ]
    return Chart(name, "time [s]", tuple(panels), caption)


ALL = "all"


@dataclass(frozen=True, repr=False)
class Reproduction:
    """Experiments of the thesis by name, each with its claims, tables and figures."""

    experiments: Mapping[str, ExperimentReport]

    @property
    def claims(self) -> ResultTable:
        """Every claim: experiment, section, statement, what is printed, what is found, verdict."""
        rows = [(name, *row) for name, e in self.experiments.items() for row in claim_rows(e.claims)]
        return ResultTable(("experiment", "section", "statement", "printed", "found", "verdict"), rows)

    @property
    def count(self) -> str:
        """How many claims hold, in a sentence."""
        verdicts = [c.holds for e in self.experiments.values() for c in e.claims]
        counts = [verdicts.count(v) for v in (True, False, None)]
        return f"{len(verdicts)} claims: {counts[0]} hold, {counts[1]} do not, {counts[2]} cannot be decided."

    def index(self) -> Page:
        """The page of all claims, and of the figures of the chapter with what draws them or why nothing does."""
        page = Page("Chapter 6 of the thesis, run again", self.count)
        for name, experiment in self.experiments.items():
            page.heading(experiment.title)
            page.link("its tables, figures and remarks", f"{name}.html")
            page.table(HEAD, claim_rows(experiment.claims))
        page.heading("Figures of the chapter", detail=True)
        page.table(("figure", "drawn by, or why not"), [list(row) for row in figure_list().items()])
        return page

    def tables(self) -> str:
        """All tables, aligned for a terminal."""
        return "\n".join(
            f"{title} ({name})\n{aligned([head, *(list(map(str, row)) for row in rows)], [False] * len(head))}\n"
            for name, experiment in self.experiments.items()
            for title, head, rows in experiment.tables
        )

    def report(self, out: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> None:
        """Write index.html, a page for each experiment, claims.txt, claims.json, tables.txt; as Discovery.report."""
        with new_folder(Path(out), force=force) as folder:
            write_page(self.index(), folder, name="index", command=command)
            for name, experiment in self.experiments.items():
                write_page(experiment_page(experiment), folder, figures, name, command)
            (folder / "claims.txt").write_text(f"{self!r}\n", encoding="utf-8")
            (folder / "tables.txt").write_text(self.tables(), encoding="utf-8")
            content = {name: [c._asdict() for c in e.claims] for name, e in self.experiments.items()}
            write_json(folder / "claims.json", {"schema": "shake_ros.reproduce/1", "claims": content})

    def __repr__(self) -> str:
        return self.index().text()


def figure_list() -> dict[str, str]:
    """Figures of chapter 6 by number, or numbers from to, and what draws them or why nothing does."""
    content: dict[str, str] = read_yaml(find("reproduce", "figures"))
    return content


def known_experiments(names: Sequence[str]) -> list[str]:
    """The names once each, all of them for none or "all"; raises UnknownName."""
    for name in names:
        if name not in (*EXPERIMENTS, ALL):
            raise unknown_name("experiment", name, [*EXPERIMENTS, ALL])
    return list(EXPERIMENTS) if ALL in names or not names else list(dict.fromkeys(names))


def reproduce(*names: str, progress: ProgressOption = True) -> Reproduction:
    """Run experiments of the thesis's chapter 6 again; minutes for all of them.

    Parameters
    ----------
    names : of experiments; none or "all" means every one.
    progress : whether to show it, or a function to call with it.

    Raises
    ------
    UnknownName
        With the experiments there are.

    Examples
    --------
    >>> import shake_ros as sr
    >>> found = sr.reproduce("sensitivity", progress=False)
    >>> found.claims["verdict"][0]
    'does not hold'
    """
    wanted = known_experiments(names)
    found = {}
    with Progress("reproduce", progress) as bar:
        for i, name in enumerate(wanted):
            bar.span(i / len(wanted), (i + 1) / len(wanted))
            bar(EXPERIMENTS[name].line, 0.0)
            experiment = importlib.import_module(f"shake_ros.thesis.{EXPERIMENTS[name].module}")
            found[name] = experiment.run(bar)
    return Reproduction(found)
