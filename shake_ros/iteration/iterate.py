"""`iterate`: the drive, or the model, of the next run from the acceleration that the last one missed; its page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Data, recordings
from shake_ros.control.metrics import FREQUENCIES, HIGHEST, LOWEST
from shake_ros.declared import effect_candidates, free_parameters, model_structure, search_settings
from shake_ros.fit.records import Record
from shake_ros.iteration.drive import Iteration, Run, drive_from_best, error_in_band, iterate_model, refit, verdict
from shake_ros.iteration.drive import iterate as corrected
from shake_ros.iteration.table import SimulatedRuns, SimulatedTable
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError, unknown_name
from shake_ros.recordings.bags import TableRecording
from shake_ros.recordings.reference_file import build_program, write_drive
from shake_ros.repair.close_loop import close_loop
from shake_ros.report.chart import Chart, ChartSeries, Panel, static_figure
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.search.search_settings import SearchSettings
from shake_ros.search.unlisted_functions import UNLISTED
from shake_ros.settings import load_parameters, load_table, save_table

Array = NDArray[np.float64]

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def error_chart(runs: Sequence[str], curves: Sequence[tuple[str, Sequence[float], str]]) -> Chart:
    """Errors run by run; curves : label, error of each run [-], colour."""
    number = np.arange(1, len(runs) + 1, dtype=np.float64)
    series = tuple(
        ChartSeries(label, 100.0 * np.asarray(values, dtype=np.float64), colour, kind="marks")
        for label, values, colour in curves
    )
    ticks = dict(zip(number.tolist(), runs, strict=True))
    view = (0.5, len(runs) + 0.5)
    panel = Panel("error [%]", number, series, height=210)
    return Chart("errors", "run", (panel,), "Error of the runs in their order", view=view, ticks=ticks)


def spectrum_chart(wanted: Array, spectra: Sequence[Array], best: int) -> Chart:
    """Response spectra [m/s²] as of `loop.metrics.spectrum_of`: wanted, of the first run and of the best."""
    frequencies = np.geomspace(LOWEST, HIGHEST, FREQUENCIES)
    series = [ChartSeries("wanted", wanted, "measured", width=2.4)]
    if best:
        series.append(ChartSeries("run 1", spectra[0], "before"))
    series.append(ChartSeries(f"run {best + 1}, the best", spectra[best], "after"))
    panel = Panel("response [m/s²]", frequencies, tuple(series), height=230)
    caption = "Response spectrum at 5 % damping: largest acceleration of an oscillator of each frequency"
    return Chart("spectra", "frequency [Hz]", (panel,), caption, log_x=True)


@dataclass(frozen=True, repr=False)
class Iterated(Result):
    """The next run of an iteration.

    Attributes
    ----------
    runs : names of the runs so far.
    missed : error of their acceleration within the band [-].
    drive : position, velocity, acceleration of the next run, shape (n, 3) [m, m/s, m/s²]; None where the model is
        fitted.
    sample_time : [s].
    factor : by which the drive was scaled to stay within its limits [-].
    model : fitted to the last run, or that of the best run where its drive was corrected on a simulated table.
    simulated : the runs on a simulated table, where they were made on one.
    reason : why its runs ended.
    wrong : that the runs diverge or have not converged; empty where nothing is wrong.
    first_model : of the first run's feedforward, where there was one.
    records : the runs as a fit takes them.
    """

    numbers = "iteration.json"
    runs: tuple[str, ...]
    missed: tuple[float, ...]
    sample_time: float
    drive: Array | None = None
    factor: float = 1.0
    model: TableParameters | None = None
    simulated: SimulatedRuns | None = None
    reason: str = ""
    wrong: str = ""
    first_model: TableParameters | None = None
    records: tuple[Record, ...] = ()

    def lacking(self, settings: SearchSettings | None = None, progress: ProgressOption = True) -> str:
        """Which effect the model of the runs lacks, in a sentence, as `close_loop` finds it in the first and last.

        settings : of the search, where not those of config/discovery/search.yaml.
        """
        if self.first_model is None:
            return "no model of the table is given, so what it lacks cannot be looked for"
        if len(self.records) < 2:
            return "one run does not show what the model lacks; close_loop needs two"
        model, first, last = model_structure(self.first_model), self.records[:1], self.records[-1:]
        with Progress("close_loop on the runs", progress) as bar:
            found = close_loop(model, first, last, settings or search_settings(), bar).verdicts
        if not found:
            return (
                "close_loop on the runs finds nothing missing from the model: the gains do not suit this table; "
                "./shake tune makes new ones"
            )
        others = [f"; or {', '.join(s.alternatives)}" if s.alternatives else "" for s in found]
        effects = ", ".join(f"{s.effect} ({s.place}{other})" for s, other in zip(found, others, strict=True))
        text = f"close_loop on the runs: the model lacks {effects}"
        names = [s.effect for s in found if s.effect != UNLISTED]
        return f"{text}; --refit {' '.join(names)} fits it to the runs" if names else text

    @property
    def best(self) -> int:
        """Index of the run that missed least."""
        return int(np.argmin(self.missed))

    @property
    def error(self) -> ResultTable:
        """Acceleration that each run missed within the band, relative to the wanted one [-]."""
        return ResultTable(("run", "error"), list(zip(self.runs, self.missed, strict=True)), {"error": percent})

    def plot(self) -> Figure:
        """Errors of the runs in their order."""
        return static_figure(self.charts()[0])

    def charts(self) -> list[Chart]:
        """Errors of the runs; on a simulated table response spectra too."""
        curves = [("measured, within the band", self.missed, "c0")]
        if self.simulated is None:
            return [error_chart(self.runs, curves)]
        curves.append(("true, all frequencies", tuple(self.simulated.errors), "c1"))
        spectra = spectrum_chart(self.simulated.aim, self.simulated.spectra, self.best)
        return [error_chart(self.runs, curves), spectra]

    def content(self) -> dict[str, Any]:
        """Content of iteration.json."""
        return {"schema": "shake_ros.iterate/1", "error_in_band": list(self.missed)}

    @property
    def page(self) -> Page:
        """The runs and what each missed."""
        runs, missed, best = self.runs, self.missed, self.best
        true = self.simulated.errors if self.simulated else ()
        page = Page("The drive, run by run", "Each run is corrected by the error of the last one.")
        page.heading("What was found")
        page.cards(
            [
                (
                    f"{percent(missed[0])} → {percent(missed[best])}",
                    f"error within the band, {runs[0]} and {runs[best]}",
                ),
                (runs[best], f"the best of {len(runs)} run{'s' * (len(runs) > 1)}, by the error within the band"),
            ]
        )
        if self.reason:
            page.paragraph(f"It ended because: {self.reason}.")
        if self.factor < 1.0:
            page.paragraph(f"The next drive was scaled by {self.factor:.3f} to stay within its limits.")
        if self.wrong:
            page.paragraph(f"The iteration {self.wrong}.")
        page.heading("Errors, run by run")
        page.paragraph("The acceleration missed, rms over that of the wanted one.")
        head = ["run", "measured, within the band", *(["true, all frequencies"] if true else [])]
        rows = [
            [name, percent(m), *([percent(true[k])] if true else [])]
            for k, (name, m) in enumerate(zip(runs, missed, strict=True))
        ]
        page.table(head, rows, best=best)
        for chart in self.charts():
            page.chart(chart)
        return page

    def files(self, work: Path, folder: Path, /) -> None:
        """Write drive.csv and drive.yaml, or model.yaml."""
        if self.model is not None:
            save_table(work / "model.yaml", self.model, "The model of the next run, by iterate.")
        if self.drive is not None:
            write_drive(work, folder, self.drive, self.sample_time)


Learn = Callable[[TableParameters, Sequence[Record]], TableParameters]


def iterate(
    wanted: str | Path,
    runs: Data,
    *,
    settings: str | Iteration = "default",
    model: str | TableParameters | None = None,
    refit: Sequence[str] | None = None,
) -> Iterated:
    """The next run of the same motion from the runs so far.

    Parameters
    ----------
    wanted : the motion that the table should make: a name of config/reference or a YAML file.
    runs : recordings of it or their paths, oldest first, each from the start of its reference, with imu and reference.
    settings : how a drive is corrected: a name of config/iteration, a YAML file, or the settings.
    model, refit : where given, the drive stays and this table, with these effects, is fitted to the last run.

    Raises
    ------
    ShakeError
        A recording lacks a topic or is too short, or sample times differ.

    Examples
    --------
    A run in which the table reached nine tenths of the wanted acceleration:

    >>> import numpy as np
    >>> import shake_ros as sr
    >>> from shake_ros.recordings.reference_file import build_program
    >>> wanted = np.array(build_program("earthquake_rock", 0.002).states)
    >>> time, rest = np.arange(len(wanted)) * 0.002, np.zeros(len(wanted))
    >>> run = sr.recording("run", time, rest, 0.9 * wanted[:, 0], acceleration=0.9 * wanted[:, 2], reference=wanted)
    >>> following = sr.iterate("earthquake_rock", run)
    >>> following.error
    run    error
    run  10.00 %
    >>> following.drive.shape == wanted.shape
    True
    """
    parameters = load_iteration(settings)
    found = recordings(runs)
    if not found:
        raise ShakeError("iterate: no recording of a run")
    learn, carried = learning(refit), None if model is None else load_table(model)
    sample_time = round(found[0].sample_time, 7)
    target = build_program(str(wanted), sample_time).states[:, 2]
    made = [_run(recording, len(target), sample_time) for recording in found]
    missed = tuple(error_in_band(target, run.achieved, sample_time, parameters) for run in made)
    wrong = _growth(missed, parameters)
    known: dict[str, Any] = {"wrong": wrong, "first_model": carried, "records": tuple(found.records()) if wrong else ()}
    if learn is not None:
        if carried is None:
            raise ShakeError("--refit: needs --model, the table that is fitted")
        return Iterated(found.names, missed, sample_time, model=learn(carried, found[-1:].records()), **known)
    drive, factor = drive_from_best(target, made, missed, sample_time, parameters)
    return Iterated(found.names, missed, sample_time, drive, factor, **known)


def iterate_simulated(
    wanted: str | Path,
    table: SimulatedTable | str = "bergamo",
    *,
    runs: int | None = None,
    settings: str | Iteration = "default",
    model: str | TableParameters | None = None,
    refit: Sequence[str] | None = None,
) -> Iterated:
    """Runs of one motion on a simulated table, each from what the last one missed, until nothing is gained.

    Parameters
    ----------
    wanted, settings, refit : as in `iterate`.
    table : the simulated table, or the name of its configuration.
    runs : most runs.
    model : of the feedforward and of an observer that has a model, with `refit` of the first run; the table as it is
        declared where not given. Without `refit` its specimen is weighed by the forces of the first run.

    Raises
    ------
    ShakeError
        A run diverged.
    """
    parameters = load_iteration(settings) if runs is None else load_iteration(settings).replace(runs=runs)
    played = SimulatedTable(table) if isinstance(table, str) else table
    carried = load_table(model or played.declared)
    learn = learning(refit)
    first = np.array(build_program(str(wanted), played.sample_time).states)
    made, dt = SimulatedRuns(played, carried, first, parameters), played.sample_time
    references = list[Array]()
    if learn is not None:
        models, missed, reason = iterate_model(first[:, 2], carried, made.record, learn, parameters)
    else:
        references, missed, reason = corrected(first[:, 2], first, made.play, dt, parameters, made.weighed_anew)
        models = made.models
    best = int(np.argmin(missed))
    return Iterated(
        tuple(f"run {k + 1}" for k in range(len(missed))),
        tuple(missed),
        dt,
        references[best] if references else None,
        model=models[best],
        simulated=made,
        reason=reason,
        wrong=verdict(missed, parameters),
        first_model=carried,
        records=tuple(made.records),
    )


def _growth(missed: Sequence[float], parameters: Iteration) -> str:
    """That the given runs diverge; empty where they do not, or where there is only one."""
    text = verdict(missed, parameters) if len(missed) > 1 else ""
    return text if text.startswith("diverges") else ""


def load_iteration(settings: str | Iteration) -> Iteration:
    """Settings of config/iteration by name or file, or as given."""
    if isinstance(settings, Iteration):
        return settings
    return load_parameters("iteration", settings, Iteration)


def learning(effects: Sequence[str] | None) -> Learn | None:
    """`refit` of the declared parameters and those of named effects; None where nothing is to be fitted."""
    if effects is None:
        return None
    free, known = free_parameters(), {c.effect: c for c in effect_candidates()}
    for effect in effects:
        if effect not in known:
            raise unknown_name("effect", effect, known, "--refit")
    chosen = [known[effect] for effect in effects]
    return lambda table, records: refit(table, free, chosen, records)


def _run(recording: TableRecording, samples: int, sample_time: float) -> Run:
    """The played and the measured acceleration of a recording from the first sample of its reference on."""
    part, name = recording.longest, recording.name
    for topic, content in (("imu", part.acceleration), ("reference", part.reference)):
        if content is None:
            raise ShakeError(f"{name}: no topic {topic}")
    assert part.acceleration is not None and part.reference is not None
    known = np.flatnonzero(np.isfinite(part.reference).all(axis=1))
    first = int(known[0]) if known.size else len(part.time)
    played = part.reference[first : first + samples, 2]
    if len(played) < samples or not np.isfinite(played).all():
        raise ShakeError(f"{name}: {known.size} unbroken samples of the reference, the wanted motion has {samples}")
    if abs(part.sample_time - sample_time) > 1e-3 * sample_time:
        raise ShakeError(
            f"{name}: a sample every {part.sample_time:g} s, the recordings before every {sample_time:g} s"
        )
    return Run(played, part.acceleration[first : first + samples])
