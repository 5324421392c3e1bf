"""`schedule`: the thesis's neural schedule of θ_1 … θ_7 (6.3.5) beside the physical effect, on the same recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shake_ros.api.fitted import Data, fit_data
from shake_ros.api.progress import Progress, Told
from shake_ros.api.result_table import ResultTable, percent
from shake_ros.api.schedule_models import SeedResult, ValidationRuns, chosen, compare, simulated
from shake_ros.core.identification.network import Training
from shake_ros.core.identification.schedule import WINDOW
from shake_ros.core.quantities import ShakeError, strict_keys
from shake_ros.data.results import write_folder, write_json
from shake_ros.settings import find, load_table, read_yaml

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CHANNELS = ("velocity", "acceleration")
KEYS = {
    *("table", "truth", "effect", "parameters", "sample_time", "amplitudes", "frequencies", "doubling", "sum", "seed"),
    "seeds",
}


@dataclass(frozen=True)
class ScheduleComparison:
    """One set of parameters, the neural schedule, and the physical effect side by side.

    Attributes
    ----------
    seeds : one network for each, on the windows that it has not seen. compared : free runs over the validation data.
    change : when the amplitude doubles in the first of them [s]; None for recordings of one's own.
    """

    seeds: Sequence[SeedResult]
    compared: Sequence[ValidationRuns]
    change: float | None

    @property
    def training(self) -> Training:
        """Of the network that runs over the validation data: the one with the least error on the part to stop by."""
        return chosen(self.seeds)

    @property
    def windows(self) -> ResultTable:
        """Error of the free run over the windows held out, by seed and by what gives the parameters [-]."""
        entries = [(one.seed, name, *errors) for one in self.seeds for name, errors in one.errors.items()]
        return ResultTable(("seed", "parameters", *CHANNELS), entries, dict.fromkeys(CHANNELS, percent))

    @property
    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        t, first = self.training, self.compared[0]
        content: dict[str, Any] = {
            "schema": "shake_ros.schedule/1",
            "training": {"learn": t.learn, "stop": t.stop, "test": t.test, "epochs": t.epochs},
            "seeds": [
                {
                    "seed": one.seed,
                    "epochs": one.training.epochs,
                    "kept": one.training.kept,
                    "learn": one.training.learn,
                    "stop": one.training.stop,
                    "test": one.training.test,
                    "radial_basis": one.radial_basis,
                    "windows": {n: dict(zip(CHANNELS, e, strict=True)) for n, e in one.errors.items()},
                }
                for one in self.seeds
            ],
            "error": {c.record.name: {name: c.error(name) for name in c.runs} for c in self.compared},
        }
        if self.change is not None:
            content["after_change"] = {
                "within_window": {n: first.error(n, self.change, self.change + WINDOW) for n in first.runs},
                "later": {n: first.error(n, self.change + WINDOW) for n in first.runs},
            }
        return content

    @property
    def error(self) -> ResultTable:
        """Error of the free run over the validation data by model; of the first recording also after its change [-]."""
        content = self.content
        rows = dict(content["error"])
        for key, title in (("within_window", f"first {WINDOW:g} s after the change"), ("later", "later")):
            if "after_change" in content:
                rows[title] = content["after_change"][key]
        entries = [(title, name, *map(e.get, CHANNELS)) for title, models in rows.items() for name, e in models.items()]
        return ResultTable(("recording", "model", *CHANNELS), entries, dict.fromkeys(CHANNELS, percent))

    def plot(self, recording: int = 0) -> Figure:
        """Running error of the acceleration of all models over a recording, by its number."""
        from shake_ros.report.schedule_page import running_chart
        from shake_ros.report.static_figure import static_figure

        chosen = self.compared[recording]
        return static_figure(running_chart(chosen.record, chosen.runs, self.change if recording == 0 else None))

    def report(self, folder: str | Path, force: bool = False, *, figures: str | None = None, command: str = "") -> Path:
        """Write report.json and report.html; options as of `Discovery.report`."""
        from shake_ros.report.schedule_page import schedule_page
        from shake_ros.report.written import write_page

        content = self.content
        data = [(c.record, c.runs) for c in self.compared]
        page = schedule_page(self.seeds, self.training, data, content, self.change, command)

        def fill(out: Path) -> None:
            write_json(out / "report.json", content)
            write_page(page, out, figures)

        write_folder(Path(folder), fill, force=force)
        return Path(folder)


def schedule(
    estimation: Data | None = None,
    validation: Data | None = None,
    *,
    settings: str | Mapping[str, Any] = "default",
    progress: Told = True,
) -> ScheduleComparison:
    """Compare one set of parameters, the neural schedule and the physical effect.

    Parameters
    ----------
    estimation, validation : recordings to train on and to compare on; without them, data are simulated.
    settings : a name of config/schedule, a YAML file, or its content.
    progress : show it, or a function to tell what is being done and which part is done.

    Raises
    ------
    ShakeError
        One of the two sets alone, no stretch of two seconds, or an unknown name in the settings.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.schedule(sr.recording("short", [0.0, 0.1], [0.0, 0.0], [0.0, 0.0]))
    Traceback (most recent call last):
        ...
    shake_ros.core.quantities.ShakeError: schedule: estimation and validation data, both or neither
    """
    if (estimation is None) != (validation is None):
        raise ShakeError("schedule: estimation and validation data, both or neither")
    content = read_settings(settings) if isinstance(settings, str) else dict(settings)
    table, change = load_table(content["table"]), None
    if estimation is None:
        first, second = simulated(content, table)
        change = float(content["doubling"]["at"])
    else:
        first, second = fit_data(estimation, validation, "valve_command")
    with Progress("schedule", progress) as bar:
        return ScheduleComparison(*compare(content, table, first, second, bar), change)


def read_settings(name: str) -> dict[str, Any]:
    """The content of a configuration; missing and unknown keys are errors."""
    path = find("schedule", name)
    return dict(strict_keys(read_yaml(path), KEYS, str(path), sorted(KEYS), kind="key"))
