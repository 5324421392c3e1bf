"""`close_loop`: what the declared model is missing: found in recordings, traced to an effect, added, validated."""

from __future__ import annotations

from dataclasses import replace

from shake_ros.api import fitted
from shake_ros.api.discovery import Discovery, completed
from shake_ros.api.fitted import test_records
from shake_ros.api.model import Model
from shake_ros.api.progress import Ending, Progress, ProgressOption
from shake_ros.core.discovery.problem import unstopped
from shake_ros.core.discovery.search_settings import SearchSettings
from shake_ros.core.failures import Failures
from shake_ros.declared import model_structure, recordings_to_make, search_settings
from shake_ros.search import close_loop as closing


def close_loop(
    model: Model,
    estimation: fitted.Data,
    validation: fitted.Data,
    *,
    test: fitted.Data | None = None,
    settings: SearchSettings | None = None,
    tune: bool = False,
    minutes: float | None = None,
    progress: ProgressOption = True,
) -> Discovery:
    """Find what a declared model is missing, and add it.

    Parameters
    ----------
    model : from `sr.model`.
    estimation : recordings to fit.
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
    >>> from shake_ros.core.plant.axis import AXIS_LAYOUT
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
    declared = model.declared
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
        found_and_judged = completed(model, found, data, test_data, asked, bar, failures, tune=tune)
        return replace(found_and_judged, unused=fitted.unused_signals(estimation, validation))
