"""`identify`: the declared model fitted to recordings: parameters with standard errors, error on every recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shake_ros.api import fitted
from shake_ros.api.model import Model, declared_of
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Data
from shake_ros.declared import model_structure, recordings_to_make, search_settings
from shake_ros.explain.diagnosis import Diagnosis, diagnose
from shake_ros.fit.axis_model import InverseDynamics, position_errors
from shake_ros.fit.nuisances.estimates import NuisanceEstimates, estimated_null_shifts, without_null_shifts
from shake_ros.fit.nuisances.prepared import Prepared
from shake_ros.fit.records import Record
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.report.chart import static_figure
from shake_ros.report.close_loop_page import error_meaning, mean_error, parameters_section
from shake_ros.report.page import Page
from shake_ros.report.report_json import (
    IDENTIFY_SCHEMA,
    axis_json,
    diagnosis_json,
    form_errors_json,
    model_json,
    unknown_json,
)
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.report.sections import (
    errors_section,
    histories_section,
    identified_section,
    known_section,
    remains_section,
    slow_changes_section,
    sources_of,
)
from shake_ros.report.text import error_table
from shake_ros.result_folder import write_json
from shake_ros.search import declared_fit
from shake_ros.search.declared_fit import FittedModel
from shake_ros.settings import save_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS = ("free_run", "inverse_dynamics")


@dataclass(frozen=True, repr=False)
class Identification(fitted.FittedResult):
    """A fitted model.

    Attributes
    ----------
    model : as declared.
    start : the table that the fit began with.
    fit : table, parameters and errors.
    estimation, validation : the gapless segments of the recordings.
    diagnosis : tests of the residuals, what the recordings identify, and which one would help.
    data : the recordings as fitted, with what was taken out.
    """

    model: Model
    start: TableParameters
    fit: FittedModel
    estimation: Sequence[Record]
    validation: Sequence[Record]
    diagnosis: Diagnosis
    data: Prepared

    @property
    def final(self) -> FittedModel:
        """The fitted model."""
        return self.fit

    @property
    def error(self) -> ResultTable:
        """Error of the free run of every recording, relative to the measured signal [-]."""
        return error_table({"": self.fit})

    @property
    def position_error(self) -> dict[str, float]:
        """Root mean square position error of the free run by recording [m]; empty but for the model axis."""
        return position_errors(self.table, self.records) if self.model.kind == "axis" else {}

    def plot(self, recording: str | None = None) -> Figure:
        """The two seconds of a recording that move most: measured, as declared, as fitted; the first one validated."""
        from shake_ros.report.charts_fit import free_runs, history_chart

        record = fitted.chosen_record([*self.validation, *self.estimation], recording)
        runs = free_runs(record, self.start, self.table, self.model.declared)
        return static_figure(history_chart(record, runs, ("as declared", "fitted")))

    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        names = fitted.names_of(self.estimation), fitted.names_of(self.validation)
        content = {
            "schema": IDENTIFY_SCHEMA,
            "model": self.model.kind,
            "recordings": dict(zip(("learn", "hold"), names, strict=True)),
            **model_json(self.fit),
            "form_errors": form_errors_json(self.fit.parameters),
        }
        identified = self.identified_estimates
        content |= unknown_json(identified, self.data) if identified else {}
        if self.model.kind == "axis":
            content |= {"position_error": self.position_error, **axis_json(self.table, self.records)}
        return content

    @cached_property
    def page(self) -> Page:
        """What was found, and how certain it is."""
        model, sets = self.fit, (self.estimation, self.validation)
        learn, hold = (", ".join(fitted.names_of(records)) for records in sets)
        checked = f"; validated on {hold}" if hold else "; there was no validation data"
        page = Page("The fitted model", f"Estimated from {learn}{checked}.", sources_of(*sets))
        page.heading("What was found, and how certain it is")
        resting = [p.name for p in model.parameters if p.std_error is None]
        unknown = [p.name for p in model.parameters if p.std_error is not None and p.std_error > abs(p.value)]
        count = len(model.parameters)
        page.cards(
            [
                (percent(mean_error(model.validation or model.estimation)), error_meaning(model)),
                (f"{count - len(resting) - len(unknown)} of {count}", "parameters known to better than their own size"),
                (str(len(resting)), f"at a bound or without effect{': ' * bool(resting)}{', '.join(resting)}"),
            ]
        )
        if unknown:
            page.paragraph(f"Not known from these recordings: {', '.join(unknown)}.")
        identified_section(page, self.identified_estimates, self.data)
        labels = ("as declared", "fitted")
        bands = histories_section(page, *sets, (self.start, model.table), self.model.declared, labels)
        errors_section(page, {"fitted": model}, bands, labels)
        slow_changes_section(page, self.compared, self.records)
        remains_section(page, self.diagnosis)
        parameters_section(page, {"value": model})
        known_section(page, self.diagnosis)
        return page

    def files(self, work: Path, _: Path, /) -> None:
        """Write diagnosis.json and table.yaml."""
        write_json(work / "diagnosis.json", diagnosis_json(self.diagnosis))
        names = ", ".join(fitted.names_of(self.estimation))
        comment = f"Fitted to {names} by identify.{fitted.command_comment(self.data)}"
        save_table(work / "table.yaml", self.table, comment)


def identify(
    model: Model,
    estimation: Data,
    validation: Data | None = None,
    *,
    method: str = "free_run",
    progress: ProgressOption = True,
) -> Identification:
    """Fit a declared model to recordings.

    Parameters
    ----------
    model : from `sr.model`.
    estimation : recordings to fit, or their paths.
    validation : recordings that the fit does not see.
    method : "free_run" fits the error of the simulation from the command alone; "inverse_dynamics" that of the force,
        for the model axis.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError
        A recording cannot be fitted, is in both sets, or the method does not go with the model.

    Examples
    --------
    An axis of 10 kg under a known force, without friction:

    >>> import numpy as np
    >>> import shake_ros as sr
    >>> time = np.arange(3000) / 1000
    >>> force, position = 100 * np.sin(9 * time), -np.sin(9 * time) / 8.1
    >>> runs = sr.recording("push", time, 0 * time, position, force=force)
    >>> fitted = sr.identify(sr.model("axis"), runs, method="inverse_dynamics", progress=False)
    >>> round(fitted.table.value("axis.mass"), 1)
    10.0
    """
    declared = declared_of(model)
    if method not in METHODS:
        raise ShakeError(f"method {method}: known are {' and '.join(METHODS)}")
    if method == "inverse_dynamics" and model.kind != "axis":
        raise ShakeError(f"--method inverse_dynamics: needs --model axis, not {model.kind}")
    records = fitted.fit_data(estimation, validation, declared.driven_by)
    with Progress("identify", progress if method == "free_run" else False) as bar:
        bar.span(0.0, 0.4)
        start = model.begin(*records, bar)
        data = start.data
        first, second = data.estimation, data.validation
        structure, settings = model_structure(start, declared), search_settings(declared)
        if method == "inverse_dynamics":
            found = declared_fit.identify_inverse(structure, first, second, settings)
            blocks = InverseDynamics(first).blocks()
            diagnosis = diagnose(found.fit, first, second, recordings_to_make(), declared, blocks)
            return Identification(model, start.table, found, first, second, diagnosis, data)
        bar.span(0.4, 0.85)
        found = declared_fit.identify(structure, first, second, settings, bar)
        data = data.with_nuisances(NuisanceEstimates(shifts=estimated_null_shifts(declared, found.fit, first, second)))
        found = replace(found, fit=without_null_shifts(found.fit, first, data.estimation))
        first, second = data.estimation, data.validation
        bar.span(0.85, 1.0)
        bar("residuals and what would help", 0.0)
        diagnosis = diagnose(found.fit, first, second, recordings_to_make(), declared)
    return Identification(model, start.table, found, first, second, diagnosis, data)
