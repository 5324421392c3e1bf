"""`schedule`, and experiment 6.3.5: a neural schedule of θ_1 … θ_7 beside the physical effect, on the same recordings.

The three models are fitted to the same windows and run over the same validation data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shake_ros.api.fitted import fit_data
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Data
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.declared_model import FULL
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import Fit, best_start, fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record, relative_error
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import ShakeError
from shake_ros.report.chart import Chart, ChartSeries, Panel, static_figure
from shake_ros.report.page import Page, Result
from shake_ros.report.result_table import ResultTable, percent
from shake_ros.report.sections import sources_of
from shake_ros.settings import load_content, load_table
from shake_ros.signals.velocity_filter import filtered_velocity
from shake_ros.thesis.network import WINDOW, SeedResult, Training, pieces, run_scheduled, trained, window_fits
from shake_ros.thesis.reproduce import Claim, ExperimentReport, Rows, asked_in, noisy, recorded

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ENOUGH = 8  # windows on which one set of parameters and the effect are fitted, evenly spread
SMOOTH = 0.5  # of the running error shown [s]


@dataclass(frozen=True)
class ValidationRuns:
    """Free runs over one recording by the name of the model, columns as plant/simulation.py:COLUMNS."""

    record: Record
    runs: dict[str, np.ndarray]

    def error(self, name: str, first: float = 0.0, last: float = np.inf) -> dict[str, float]:
        """Relative errors between two times [s]."""
        r, dt = self.record, self.record.sample_time
        span = slice(max(r.start, round(first / dt)), len(r.commands) if last == np.inf else round(last / dt))
        found = {"velocity": relative_error(r.velocity[span], filtered_velocity(self.runs[name][:, 1], dt)[span])}
        if r.acceleration is not None:
            found["acceleration"] = relative_error(r.acceleration[span], self.runs[name][span, 2])
        return found


def simulated(settings: Mapping[str, Any], table: TableParameters) -> tuple[list[Record], list[Record]]:
    """Sines to learn from; the doubled amplitude and a sum of sines to validate."""
    truth, dt = table.with_values(settings["truth"]), float(settings["sample_time"])
    rng = np.random.default_rng(int(settings["seed"]))

    def measured(name: str, command: np.ndarray) -> Record:
        return noisy(recorded(name, truth, command, dt), truth, rng)

    time = np.arange(round(WINDOW / dt)) * dt
    grid = [(float(a), float(f)) for a in settings["amplitudes"] for f in settings["frequencies"]]
    learn = [measured(f"{a:g} at {f:g} Hz", a * np.cos(2.0 * np.pi * f * time)) for a, f in grid]
    step, several = settings["doubling"], settings["sum"]
    time = np.arange(round(step["seconds"] / dt)) * dt
    doubled = np.where(time < step["at"], 1.0, 2.0) * step["amplitude"] * np.sin(2.0 * np.pi * step["frequency"] * time)
    time = np.arange(round(several["seconds"] / dt)) * dt
    waves = zip(several["amplitudes"], several["frequencies"], strict=True)
    total = np.sum([a * np.cos(2.0 * np.pi * f * time) for a, f in waves], axis=0)
    return learn, [measured("amplitude doubled", doubled), measured("sum of sines", total)]


def with_effect(settings: Mapping[str, Any], declared: Fit, windows: list[Record]) -> TableParameters:
    """The table with the physical effect, fitted from the best of its trials."""
    candidate = next((c for c in effect_candidates() if c.effect == settings["effect"]), None)
    if candidate is None:
        raise ShakeError(f"config/schedule: unknown effect '{settings['effect']}'")
    free = declared.free.extended(candidate.free)
    problem = RecordingProblem(windows[:: max(len(windows) // ENOUGH, 1)])
    values = dict(zip(declared.free.names, (declared.x * declared.free.scale).tolist(), strict=True))
    starts = np.array([free.x_of({**values, **trial}) for trial in candidate.trials])
    start = best_start(problem, free, starts)
    return free.table(fit(problem, free, start, evaluations=15, tolerance=1e-3).x)


def compare(
    settings: Mapping[str, Any], table: TableParameters, learn: list[Record], hold: list[Record], bar: Progress
) -> tuple[list[SeedResult], list[ValidationRuns]]:
    """Fit, train once for each seed, and run all three models over the validation data.

    The network that runs over the validation data is that with the least error on the part to stop by.
    """
    windows = pieces(learn)
    if not windows:
        raise ShakeError(f"--learn: no segment of {WINDOW:g} s")
    known = {f.name: f for f in free_parameters()}
    missing = [name for name in settings["parameters"] if name not in known]
    if missing:
        raise ShakeError(f"config/schedule: parameter '{missing[0]}' is not in config/identification/full.yaml")
    free = FreeParameters(table, [known[name] for name in settings["parameters"]])
    bar("one set of parameters", 0.0)
    spread = windows[:: max(len(windows) // ENOUGH, 1)]
    declared = fit(RecordingProblem(spread), free, free.start(), evaluations=15, tolerance=1e-3)
    bar("parameters of every window", 0.1)
    data = window_fits(windows, free, declared.x)
    seeds = []
    for k, seed in enumerate(settings["seeds"]):
        bar(f"training of the network, seed {seed}", 0.3 + 0.5 * k / len(settings["seeds"]))
        seeds.append(trained(int(seed), windows, free, declared.x, data))
    bar("the physical effect", 0.8)
    extended = with_effect(settings, declared, windows)
    bar("validation recordings", 0.9)
    fixed, network = free.table(declared.x), chosen(seeds).network
    compared = []
    for record in hold:
        runs = {
            "one set": FULL.run(fixed, record),
            "schedule": run_scheduled(network, free, record),
            settings["effect"]: FULL.run(extended, record),
        }
        compared.append(ValidationRuns(record, runs))
    return seeds, compared


def chosen(seeds: Sequence[SeedResult]) -> Training:
    """The training with the least error on the part to stop by, in spreads of the parameters."""
    return min((one.training for one in seeds), key=lambda t: t.stop)


def learning_chart(training: Training) -> Chart:
    """Mean squares of the scaled error after every epoch, on the three parts."""
    names = ("to learn", "before"), ("to stop by", "measured"), ("to test", "after")
    series = (ChartSeries(n, training.curves[:, k], colour) for k, (n, colour) in enumerate(names))
    panel = Panel("mean square error [-]", np.arange(float(len(training.curves))), tuple(series), log=True)
    caption = f"Error over the training; predicting the mean gives 1. Kept are the weights of epoch {training.kept}."
    return Chart("training", "epoch", (panel,), caption)


def better_than_one_set(seeds: Sequence[Any]) -> int:
    """How many networks leave less of the acceleration of the test windows."""
    return sum(s.errors["network"][1] < s.errors["one set"][1] for s in seeds)


def verdict(seeds: Sequence[Any]) -> str:
    """Whether the networks beat one constant set on the test windows, with the figures."""
    one, network, least = (
        float(np.mean([s.errors[n][1] for s in seeds])) for n in ("one set", "network", "fit to the window")
    )
    wins = better_than_one_set(seeds)
    beats = "beat" if wins == len(seeds) else "do not always beat"
    return (
        f"The networks {beats} one constant set ({wins} of {len(seeds)} seeds): the mean error of the acceleration is "
        f"{percent(network)} with them, {percent(one)} with one set, and {percent(least)} with parameters fitted to "
        "the test window itself, the limit of any schedule of these parameters."
    )


def answer(errors: Mapping[str, Mapping[str, Mapping[str, float]]]) -> str:
    """Which model leaves the least of the acceleration in the free run, with the errors of all, by recording."""
    means = {
        model: float(np.mean([by_model[model]["acceleration"] for by_model in errors.values()]))
        for model in next(iter(errors.values()))
    }
    best = min(means, key=lambda model: means[model])
    others = ", ".join(f"{percent(value)} with {model}" for model, value in means.items() if model != best)
    return f"{best} leaves {percent(means[best])} of the acceleration unexplained, against {others}."


TRAINING_ERRORS = "Training errors are mean squares of the scaled error of θ; predicting the mean gives 1."
CHANNELS = ("velocity", "acceleration")
KEYS = (
    *("table", "truth", "effect", "parameters", "sample_time", "amplitudes", "frequencies", "doubling", "sum", "seed"),
    "seeds",
)


@dataclass(frozen=True, repr=False)
class ScheduleComparison(Result):
    """One set of parameters, the neural schedule, and the physical effect side by side.

    Attributes
    ----------
    seeds : one network for each, on the windows that it has not seen.
    compared : free runs over the validation data.
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
    def networks(self) -> ResultTable:
        """Training of each network, by seed: mean squares of the scaled error of θ, where the mean gives 1 [-]."""
        rows = [tuple(one.figures.values()) for one in self.seeds]
        errors = ("to learn", "to stop by", "to test", "test, radial basis")
        return ResultTable(("seed", "epochs", "kept", *errors), rows, dict.fromkeys(errors, "{:.2g}".format))

    @property
    def windows(self) -> ResultTable:
        """Error of the free run over the test windows, by seed and by what gives the parameters [-]."""
        entries = [(one.seed, name, *errors) for one in self.seeds for name, errors in one.errors.items()]
        return ResultTable(("seed", "parameters", *CHANNELS), entries, dict.fromkeys(CHANNELS, percent))

    def content(self) -> dict[str, Any]:
        """Content of report.json."""
        t, first = self.training, self.compared[0]
        content: dict[str, Any] = {
            "schema": "shake_ros.schedule/1",
            "training": {"learn": t.learn, "stop": t.stop, "test": t.test, "epochs": t.epochs},
            "seeds": [
                {**one.figures, "windows": {n: dict(zip(CHANNELS, e, strict=True)) for n, e in one.errors.items()}}
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
        content = self.content()
        rows = dict(content["error"])
        for key, title in (("within_window", f"first {WINDOW:g} s after the change"), ("later", "later")):
            if "after_change" in content:
                rows[title] = content["after_change"][key]
        entries = [(title, name, *map(e.get, CHANNELS)) for title, models in rows.items() for name, e in models.items()]
        return ResultTable(("recording", "model", *CHANNELS), entries, dict.fromkeys(CHANNELS, percent))

    def running_chart(self, recording: int) -> Chart:
        """Root mean square of the acceleration's error over SMOOTH, of each model; the blind window shaded."""
        record = self.compared[recording].record
        assert record.acceleration is not None
        dt, n = record.sample_time, max(round(SMOOTH / record.sample_time), 1)
        time = np.arange(record.start, len(record.commands)) * dt
        series = []
        runs = self.compared[recording].runs.items()
        for (name, out), colour in zip(runs, ("measured", "before", "after"), strict=False):
            square = np.convolve((record.acceleration - out[:, 2]) ** 2, np.ones(n) / n, mode="same")
            series.append(ChartSeries(name, np.sqrt(np.maximum(square[record.start :], 0.0)), colour, width=1.5))
        blind = [0.0] if self.change is None or recording else [0.0, self.change]
        panel = Panel("error of the acceleration [m/s²]", time, tuple(series), height=230)
        caption = f"{record.name}: rms error over {SMOOTH:g} s; shaded: the window does not yet cover the change"
        shaded = tuple((first, first + WINDOW) for first in blind)
        return Chart(f"error_{record.name}", "time [s]", (panel,), caption, shaded=shaded)

    def plot(self, recording: int = 0) -> Figure:
        """Running error of the acceleration of all models over a recording, by its number."""
        return static_figure(self.running_chart(recording))

    @property
    def page(self) -> Page:
        """Which model leaves less, and what the networks learnt."""
        lead = f"{answer(self.content()['error'])} Both estimated from the same windows of two seconds."
        sources = sources_of((), [c.record for c in self.compared])
        page = Page("Scheduled parameters or a physical effect?", lead, sources)
        page.paragraph(
            "The network gives θ_1 … θ_7 for the amplitude and the frequency of the command over the last two seconds; "
            "the other model has one effect more and a single set of parameters. "
            "The network has two hidden layers of 100 sigmoid neurons and is trained with Levenberg–Marquardt on the "
            "parameters fitted to each window, 80 % of them for training, 10 % for stopping, 10 % for testing."
        )
        page.heading("Error of the free run on the validation data")
        page.result(self.error)
        for k, compared in enumerate(self.compared):
            if compared.record.acceleration is not None:
                page.chart(self.running_chart(k))
        page.heading("The networks on their test windows")
        page.paragraph(verdict(self.seeds))
        page.paragraph(TRAINING_ERRORS)
        page.result(self.networks)
        page.result(self.windows)
        page.chart(learning_chart(self.training))
        return page


def schedule(
    estimation: Data | None = None,
    validation: Data | None = None,
    *,
    settings: str | Mapping[str, Any] = "default",
    progress: ProgressOption = True,
) -> ScheduleComparison:
    """Compare one set of parameters, the neural schedule and the physical effect.

    Parameters
    ----------
    estimation, validation : recordings to train on and to compare on; without them, data are simulated.
    settings : a name of config/schedule, a YAML file, or its content.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError
        One of the two sets alone, no segment of two seconds, or an unknown name in the settings.

    Examples
    --------
    >>> import shake_ros as sr
    >>> sr.schedule(sr.recording("short", [0.0, 0.1], [0.0, 0.0], [0.0, 0.0]))
    Traceback (most recent call last):
        ...
    shake_ros.quantities.ShakeError: schedule: estimation and validation data, both or neither
    """
    if (estimation is None) != (validation is None):
        raise ShakeError("schedule: estimation and validation data, both or neither")
    content = load_content("schedule", settings, KEYS)[0] if isinstance(settings, str) else dict(settings)
    table, change = load_table(content["table"]), None
    if estimation is None:
        first, second = simulated(content, table)
        change = float(content["doubling"]["at"])
    else:
        first, second = fit_data(estimation, validation, "valve_command")
    with Progress("schedule", progress) as bar:
        return ScheduleComparison(*compare(content, table, first, second, bar), change)


EXPERIMENT_KEYS = ("settings", "good_within")
ONE, NETWORK = "one set", "schedule"


def run(progress: Progress, settings: str = "neural_schedule") -> ExperimentReport:
    """Five networks on the simulated table, beside one set of parameters and the physical effect."""
    asked = asked_in(settings, EXPERIMENT_KEYS)
    found = schedule(settings=asked["settings"], progress=progress)
    return ExperimentReport(
        title="The neural schedule",
        lead="Thesis 6.3.5: a network gives the parameters for amplitude and frequency of the last two seconds.",
        claims=_claims(found, asked["good_within"]),
        tables=[
            Rows("Test windows of the networks, free run", found.windows.columns, found.windows.cells()),
            Rows("Validation data, free run", found.error.columns, found.error.cells()),
        ],
        charts=[learning_chart(found.training), *map(found.running_chart, range(len(found.compared)))],
        remarks=(
            "The text's network: two hidden layers of 100 sigmoid neurons, Levenberg–Marquardt; 80 % of the windows "
            "for training, 10 % for stopping, 10 % for testing. The text gives neither the number of windows nor "
            "their amplitudes and frequencies; those used here are in config/schedule.",
            verdict(found.seeds),
            "./shake schedule runs the same alone, also on recordings.",
        ),
    )


def _claims(found: ScheduleComparison, good: float) -> list[Claim]:
    content = found.content()
    by_recording, later = content["error"], content["after_change"]["later"]
    effect = next(name for name in later if name not in (ONE, NETWORK))

    def each(model: str) -> str:
        return ", ".join(percent(errors[model]["acceleration"]) for errors in by_recording.values())

    wins = better_than_one_set(found.seeds)
    tests = ", ".join(f"{s.training.test:.2f}" for s in found.seeds)
    tracked = all(errors[NETWORK]["acceleration"] <= good for errors in by_recording.values())
    network, one = (later[model]["acceleration"] for model in (NETWORK, ONE))
    least = all(
        min(errors, key=lambda model: errors[model]["acceleration"]) == effect for errors in by_recording.values()
    )
    printed = "text only"
    return [
        Claim(
            "6.3.5, 6.27", "the simulated acceleration tracks the experiment with a good performance", "figure only",
            f"{each(NETWORK)}; one set {each(ONE)}", tracked,
        ),
        Claim(
            "6.3.5", "it converges while the input changes abruptly", printed,
            f"past the window {percent(network)}; one set {percent(one)}", network <= max(good, one),
        ),
        Claim(
            "6.3.5", "the network predicts for data that it has never seen", printed,
            f"test error {tests}, where the mean gives 1; better than one set in {wins} of {len(found.seeds)}",
            wins == len(found.seeds),
        ),
        Claim(
            "6.3.5", "for any input the effective bulk modulus has to be modelled", printed,
            f"with {effect} {each(effect)}", least,
        ),
    ]  # fmt: skip
