"""`close_loop`: what the declared model is missing: found in recordings, traced to an effect, added, validated."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.api import fitted
from shake_ros.api.fitted import Effects, LatentForces, prepared_alike, test_records, with_test
from shake_ros.api.model import Model, declared_of
from shake_ros.api.progress import Ending, Progress, ProgressOption
from shake_ros.api.read import Data, recordings
from shake_ros.api.tune_table import UNCERTAINTY, TunedTable, tracking, tune_table
from shake_ros.control.robust import Uncertainty
from shake_ros.control.trials import TrackingBenefit
from shake_ros.declared import model_structure, recordings_to_make, search_settings
from shake_ros.explain.dependence import Remaining
from shake_ros.explain.diagnosis import Diagnosis, diagnose
from shake_ros.explain.experiments import Candidate
from shake_ros.failures import Failures
from shake_ros.fit.axis_model import position_errors
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.start.stages import StartingPoint
from shake_ros.fit.uncertainty import Estimate, known_covariance
from shake_ros.physics.plant.parameters import FULL_LAYOUT, TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.repair import close_loop as closing
from shake_ros.repair.close_loop import LoopClosure, continued
from shake_ros.repair.rival_models import RivalModel, problem_of, rival_models
from shake_ros.report.chart import static_figure
from shake_ros.report.close_loop_page import (
    MODELS,
    force_section,
    found_section,
    model_sections,
    named,
    parameters_section,
)
from shake_ros.report.page import Page, write_page
from shake_ros.report.report_json import (
    accounts_json,
    axis_json,
    close_loop_json,
    diagnosis_json,
    failures_json,
    found_effects,
    innovations_json,
    tracking_json,
    unknown_json,
)
from shake_ros.report.result_table import ResultTable
from shake_ros.report.sections import benefit_section, identified_section, known_section, remains_section, sources_of
from shake_ros.report.text import error_table, sentence
from shake_ros.result_folder import new_folder, write_json
from shake_ros.search.declared_fit import FittedModel
from shake_ros.search.problem import unstopped
from shake_ros.search.search_settings import SearchSettings
from shake_ros.search.verdict import ESTABLISHED
from shake_ros.settings import save_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Discovery(fitted.FittedResult):
    """The declared model, what it was missing, and what remains.

    Attributes
    ----------
    model : as declared.
    closed : models before and after with the steps between them.
    estimation, validation, test : the gapless segments of the recordings; no decision used those of the last.
    diagnosis : tests of the residuals, what the recordings identify, and which one would help; None where that failed.
    tracking : the found table in closed loop under the model before and the model after; None where nothing was added,
        or where the model has no valve to control.
    data : the recordings as they were fitted, with the offsets that were removed from them.
    tuned : observer and controller for the found table, where they were asked for.
    failures : steps after the first fit that ended in an error, those of `report` as well; the result is without what
        they would have added.
    """

    model: Model
    closed: LoopClosure
    estimation: Sequence[Record]
    validation: Sequence[Record]
    diagnosis: Diagnosis | None
    tracking: TrackingBenefit | None
    data: Prepared
    tuned: TunedTable | None = None
    failures: Failures = field(default_factory=Failures)
    test: Sequence[Record] = ()

    @property
    def records(self) -> list[Record]:
        """The parts of all recordings."""
        return [*super().records, *self.test]

    @property
    def final(self) -> FittedModel:
        """The model with the effects that were found."""
        return self.closed.final

    @property
    def compared(self) -> tuple[TableParameters, ...]:
        """The tables before and after."""
        return self.closed.baseline.table, self.table

    @property
    def effects(self) -> Effects:
        """What was missing."""
        above = self.closed.remaining.above_noise
        return Effects(found_effects(self.closed), "nothing is established" if above else "nothing is missing")

    @property
    def error(self) -> ResultTable:
        """Error of the free run of every recording before and after, relative to the measured signal [-]."""
        return error_table({"before": self.closed.baseline, "after": self.closed.final})

    @property
    def position_error(self) -> dict[str, tuple[float, float]]:
        """Position error of the free run before and after by recording [m rms]; empty but for the model axis."""
        if self.model.kind != "axis":
            return {}
        before, after = (position_errors(m.table, self.records) for m in (self.closed.baseline, self.closed.final))
        return {name: (error, after[name]) for name, error in before.items()}

    @property
    def uncertainty(self) -> Uncertainty:
        """Fitted parameters that the recordings determine, and their covariance."""
        return _uncertainty(self.closed, self.estimation)

    @property
    def remaining(self) -> Remaining:
        """Whether a residual stands above the noise, where it acts and on what it depends."""
        return self.closed.remaining

    @property
    def latent_force(self) -> LatentForces:
        """The force that would have to act beside the final model, as a history with its band, by recording."""
        return LatentForces(self.closed.forces)

    @property
    def open(self) -> bool:
        """Whether a verdict is not established, or a residual stands above the noise."""
        undecided = any(v.state != ESTABLISHED for v in self.closed.verdicts)
        return undecided or bool(self.closed.candidates) or self.remaining.above_noise

    @cached_property
    def rivals(self) -> tuple[RivalModel, ...]:
        """Models that the recordings leave possible beside the one found, refitted; none where nothing is open."""
        settings = search_settings(self.model.declared)
        return rival_models(problem_of(self.closed, self.estimation, self.validation, settings), self.closed)

    def extended(
        self,
        estimation: Data,
        validation: Data | None = None,
        *,
        minutes: float | None = None,
        progress: ProgressOption = True,
    ) -> Discovery:
        """The search gone on with more recordings, from the models that it had found and their rivals.

        Parameters
        ----------
        estimation : recordings to fit beside those before, or their paths.
        validation : recordings beside the validation data before; where none is given, the second half of the motion of
            each of the others.
        minutes, progress : as of `close_loop`.

        Raises
        ------
        ShakeError
            A recording cannot be fitted, or is among those before.
        """
        declared = self.model.declared
        new = [test_records(self.model, data, (None, None))[0] for data in (estimation, validation)]
        known = set(fitted.names_of(self.records))
        if again := sorted(known & {r.name for r in (*new[0], *new[1])}):
            raise ShakeError(f"{', '.join(again)}: is among the recordings of the search already")
        first, data = prepared_alike(self.model, new[0], self.data, self.closed)
        second, data = prepared_alike(self.model, new[1], data, self.closed) if new[1] else ([], data)
        if not second:
            first, second = _halves(first)
        data = replace(data, estimation=[*self.estimation, *first], validation=[*self.validation, *second])
        begin, failures = StartingPoint.declared(self.closed.baseline.table, data), Failures()
        structure = replace(model_structure(begin, declared), free=self.closed.search.declared.fit.free.free)
        with Progress("close_loop", progress) as bar, Ending(bar, minutes) as ending:
            settings = search_settings(declared)
            sets = data.estimation, data.validation
            found = continued(structure, self.closed, *sets, settings, ending, ending.deadline_passed, failures)
            data = data.with_nuisances(found.search.nuisances)
            asked = () if ending.deadline_passed() else recordings_to_make()
            return completed(self.model, found, data, [], asked, bar, failures)

    def plot(self, recording: str | None = None) -> Figure:
        """The two seconds of a recording that move most: measured, before and after; the first one validated."""
        from shake_ros.report.charts_fit import free_runs, history_chart

        record = fitted.chosen_record([*self.validation, *self.estimation, *self.test], recording)
        tables = self.closed.baseline.table, self.table
        return static_figure(history_chart(record, free_runs(record, *tables, self.model.declared)))

    @cached_property
    def _identified(self) -> tuple[Estimate, ...]:
        """What the recordings identify; nothing where that fails."""
        found = tuple[Estimate, ...]()
        with self.failures.step("what the recordings identify"):
            found = self.identified_estimates
        return found

    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        names = [fitted.names_of(records) for records in (self.estimation, self.validation, self.test)]
        content = close_loop_json(self.closed, names[0], names[1], self.model.kind, names[2]) | {"open": self.open}
        with self.failures.step("residuals in report.json"):
            if self.diagnosis:
                content["remaining"]["predictable"] = accounts_json(self.diagnosis.accounts)
                content["remaining"]["innovations"] = innovations_json(self.diagnosis.innovations)
        content |= unknown_json(self._identified, self.data) if self._identified else {}
        with self.failures.step("positions"):
            if self.model.kind == "axis":
                errors = {n: {"before": before, "after": after} for n, (before, after) in self.position_error.items()}
                content |= {"position_error": errors, **axis_json(self.table, self.records)}
        return content

    @cached_property
    def page(self) -> Page:
        """What is missing, how certain that is, and what remains, in the order of an engineer's questions."""
        result, sets = self.closed, (self.estimation, self.validation, self.test)
        estimation, validation, tested = (", ".join(fitted.names_of(records)) for records in sets)
        lead = f"Missing: {named(result)}. Estimated from {estimation}; validated on {validation}"
        lead += f"; tested on {tested}." if tested else "."
        page = Page("What the model is missing", lead, sources_of(*sets), self.failures)
        for failure in self.failures.all:
            page.paragraph(sentence(f"{failure}; the report is without it"))
        with page.part("what was found"):
            found_section(page, result, self.tracking)
        with page.part("what the recordings identify"):
            identified_section(page, self._identified, self.data)
        with page.part("measured against simulated"):
            model_sections(page, result, *sets)
        with page.part("what remains"):
            if self.diagnosis:
                remains_section(page, self.diagnosis, result.remaining.text)
        with page.part("the force that the model lacks"):
            force_section(page, result.forces, result.model)
        with page.part("tracking"):
            if self.tracking:
                benefit_section(page, self.tracking)
        with page.part("parameters"):
            parameters_section(page, dict(zip(MODELS, (result.baseline, result.final), strict=True)))
        with page.part("what the recordings identify"):
            if self.diagnosis:
                known_section(page, self.diagnosis)
        with page.part("gains"):
            if self.tuned:
                page.heading("Observer and controller for the table")
                self.tuned.describe(page)
        return page

    def report(self, folder: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> Path:
        """Write report.json, diagnosis.json, report.html, and table.yaml with uncertainty.json beside it.

        Also tracking.json where there is a tracking; and controller.yaml, observer.yaml and tune.json where gains were
        made for the table, unless they oscillate somewhere and `force` is not given. Where a part fails, the folder is
        without it, and report.json names it under `failed`. Options as of every result.
        """
        step, content = self.failures.step, self.content()
        added = ", ".join(self.effects.names) or "nothing to add"
        with new_folder(Path(folder), force=force) as out:
            names = fitted.names_of(self.estimation)
            comment = f"Fitted to {', '.join(names)} by close_loop: {added}.{fitted.command_comment(self.data)}"
            save_table(out / "table.yaml", self.table, comment)
            with step("diagnosis.json"):
                if self.diagnosis:
                    write_json(out / "diagnosis.json", diagnosis_json(self.diagnosis))
            with step("tracking.json"):
                if self.tracking:
                    write_json(out / "tracking.json", tracking_json(self.tracking))
            with step("uncertainty.json"):
                if self.table.layout is FULL_LAYOUT:
                    known, covariance = self.uncertainty
                    write_json(out / UNCERTAINTY, {"names": list(known), "covariance": covariance.tolist()})
            with step("files of the gains"):
                if self.tuned and (self.tuned.sound or force):
                    self.tuned.write(out, force)
            with step("page"):
                write_page(self.page, out, figures, command=command)
            with step("numbers of report.json"):
                json.dumps(content, allow_nan=False)
            write_json(out / "report.json", {**content, "failed": failures_json(self.failures)})
        return Path(folder)


def close_loop(
    model: Model,
    estimation: Data,
    validation: Data,
    *,
    test: Data | None = None,
    settings: SearchSettings | None = None,
    tune: bool = False,
    minutes: float | None = None,
    progress: ProgressOption = True,
) -> Discovery:
    """Find what a declared model is missing, and add it.

    Parameters
    ----------
    model : from `sr.model`.
    estimation : recordings to fit, or their paths.
    validation : recordings that decide whether an effect is added.
    test : recordings that no decision uses; the result has the errors of every model on them.
    settings : thresholds of the search, where not those of config/discovery/search.yaml.
    tune : design observer and controller for the found table as well, as `sr.tune` does; of the full model.
    minutes : end after so many minutes with the best answer so far; a fifth of them is kept for the verdicts. Ctrl-C
        ends it as well; a second one interrupts.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError
        A recording cannot be fitted, or is in two sets.

    Examples
    --------
    Two recordings of an axis that is as it is declared:

    >>> import numpy as np
    >>> import shake_ros as sr
    >>> from shake_ros.physics.plant.axis import AXIS_LAYOUT
    >>> numbers = {"mass": 10.0, "viscous": 20.0, "coulomb": 5.0, "offset": 0.0}
    >>> true = sr.model("axis", AXIS_LAYOUT.table({"axis": numbers}, "axis"))
    >>> time, noise = np.arange(1500) / 1000, np.random.default_rng(0).normal(0.0, 1.0, (4, 1500))
    >>> def run(name, frequency, noise):
    ...     force = 100 * np.sin(9 * time) + 50 * np.sin(frequency * time)
    ...     (start,) = sr.recording(name, time, 0 * time, 1e-9 * time, force=force).records("force")
    ...     x, _, a = true.simulate(start).T
    ...     x, a = x + 1e-5 * noise[0], a + 0.05 * noise[1]
    ...     return sr.recording(name, time, 0 * time, x, acceleration=a, force=force)
    >>> found = sr.close_loop(
    ...     sr.model("axis"), run("first", 31, noise[:2]), run("second", 41, noise[2:]), progress=False
    ... )
    >>> found.effects
    nothing is missing
    >>> round(found.table.value("axis.mass"), 1), found.remaining.above_noise
    (10.0, False)
    """
    declared = declared_of(model)
    estimation, validation, test = (recordings(given) for given in (estimation, validation, test))
    records = fitted.fit_data(estimation, validation, declared.driven_by)
    test_data, stops = test_records(model, test, (estimation, validation))
    with Progress("close_loop", progress) as bar:
        with Ending(bar, minutes) as ending:
            start = model.begin(*records, unstopped(ending))
            data, structure = start.data, model_structure(start, declared)
            first, second = data.estimation, data.validation
            limits = settings or search_settings(declared)
            failures = Failures()
            found = closing.close_loop(structure, first, second, limits, ending, ending.deadline_passed, failures)
        data = data.with_nuisances(found.search.nuisances)
        data = replace(data, stops=(*data.stops, *stops))
        asked = () if ending.deadline_passed() else recordings_to_make()
        return completed(model, found, data, test_data, asked, bar, failures, tune=tune)


def completed(
    model: Model,
    found: LoopClosure,
    data: Prepared,
    test_data: list[Record],
    asked: Sequence[Candidate],
    bar: Progress,
    failures: Failures,
    *,
    tune: bool = False,
) -> Discovery:
    """What follows a search: errors on test data, uncertainty, gains, tracking, diagnosis; each may fail alone."""
    known, tuned, benefit, diagnosis = None, None, None, None
    first, second = data.estimation, data.validation
    with failures.step("test data"):
        if test_data:
            test_data, data = prepared_alike(model, test_data, data, found)
            found = with_test(found, test_data)
    with failures.step("uncertainty"):
        known = _uncertainty(found, first)
    with failures.step("tuning"):
        tuned = tune_table(found.final.table, uncertainty=known, progress=bar) if tune else None
    bar("tracking with the model before and after", 1.0)
    with failures.step("tracking"):
        benefit = tracking(found, known, tuned)
    bar("residuals and what would help", 1.0)
    with failures.step("diagnosis"):
        diagnosis = diagnose(found.final.fit, first, second, asked, model.declared)
    return Discovery(model, found, first, second, diagnosis, benefit, data, tuned, failures, test_data)


def _halves(records: Sequence[Record]) -> tuple[list[Record], list[Record]]:
    """Each record up to the middle of its significant duration, and from there: it may rest before and after."""
    middles = [_middle_of_motion(r) for r in records]
    first = [r.part(slice(0, middle)) for r, middle in zip(records, middles, strict=True)]
    return first, [r.part(slice(middle, len(r.commands))) for r, middle in zip(records, middles, strict=True)]


def _middle_of_motion(record: Record) -> int:
    """Halfway between 5 and 95 % of the squared velocity beyond its noise."""
    energy = np.maximum.accumulate(np.cumsum(record.velocity**2 - record.velocity_noise() ** 2))
    return int(np.mean(np.searchsorted(energy, [0.05 * energy[-1], 0.95 * energy[-1]])))


def _uncertainty(found: LoopClosure, estimation: Sequence[Record]) -> Uncertainty:
    problem = RecordingProblem(list(estimation), found.model)
    return Uncertainty(*known_covariance(found.final.fit, problem.blocks()))
