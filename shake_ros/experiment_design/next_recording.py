"""`next_recording`: the motion that settles what a search has left open, or why none within the limits does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shake_ros.api.close_loop import Discovery
from shake_ros.api.progress import Progress, ProgressOption
from shake_ros.api.read import Data
from shake_ros.control.reference.motion import Envelope, envelope
from shake_ros.declared import effect_candidates
from shake_ros.experiment_design.design import ENOUGH, Designer, PredictedExcitation, Separation
from shake_ros.experiment_design.further_sensors import FurtherSensor, further_sensors, lacking
from shake_ros.experiment_design.motions import library
from shake_ros.fit.uncertainty import of_table
from shake_ros.physics.plant.parameters import FULL_LAYOUT
from shake_ros.quantities import ShakeError, strict_keys
from shake_ros.recordings.reference_file import write_drive
from shake_ros.report.chart import Chart, ChartSeries, Panel
from shake_ros.report.page import Page, write_page
from shake_ros.report.text import odds_text, sentence
from shake_ros.result_folder import new_folder, write_json
from shake_ros.safety.causes import InterlockParameters
from shake_ros.safety.rehearsal import tightened
from shake_ros.search.verdict import ESTABLISHED
from shake_ros.settings import load_interlock

Array = NDArray[np.float64]
WITHIN = 0.8  # part of a declared table's envelope, and of the way to each limit of an interlock, that a motion may use
GROWTH = 2.0  # times what the recordings of an unknown table reached, the most that a motion may ask for
MORE_MASS = 0.3  # of the moved mass, as a payload that might tell rivals apart
COLOURS = ("c1", "c2", "c3", "c4")
Play = Callable[["NextRecording"], Data | None]


@dataclass(frozen=True, repr=False)
class NextRecording:
    """The recording to make next.

    Attributes
    ----------
    rivals : names of the models that are open beside the model found; empty where nothing is open.
    prediction : the motion with what it is expected to do to each rival; None where none within the limits is possible.
    limits : largest position [m], velocity [m/s] and acceleration [m/s²] that it may ask for.
    sample_time : of the motion [s].
    undecided : whether a verdict is not established, or a residual stands above the noise.
    further : what the same motion would do to the rivals that it does not settle, with each further sensor that the
        table lacks, and with MORE_MASS.
    answers : effects of the model found, and of each rival.
    """

    rivals: tuple[str, ...]
    prediction: PredictedExcitation | None
    limits: Envelope
    sample_time: float
    undecided: bool = True
    further: Mapping[str, tuple[Separation, ...]] = field(default_factory=dict)
    answers: tuple[tuple[str, ...], ...] = ()

    @property
    def open(self) -> bool:
        """Whether anything is: a model, or an effect that the recordings do not exclude and the motion would show."""
        return self.undecided or bool(self.shown)

    @property
    def useful(self) -> bool:
        """Whether the motion is expected to distinguish a rival from the model found, or to show an effect."""
        return bool(self.distinguished or self.shown)

    @property
    def distinguished(self) -> tuple[str, ...]:
        """The rivals that the motion is expected to distinguish from the model found."""
        return () if self.prediction is None else tuple(s.rival for s in self.prediction.separations if s.settles)

    @property
    def shown(self) -> tuple[str, ...]:
        """The absent effects that the recordings do not exclude, and that it is expected to show or to exclude."""
        return () if self.prediction is None else tuple(s.rival for s in self.prediction.absent if s.settles)

    @property
    def motion(self) -> Array | None:
        """Position [m], velocity [m/s] and acceleration [m/s²] to play, shape (n, 3)."""
        return self.prediction.samples if self.prediction and self.useful else None

    def motion_at(self, sample_time: float) -> Array:
        """The motion for a table of another sampling rate; ShakeError where there is none."""
        if self.prediction is None or not self.useful:
            raise ShakeError("no motion within the limits would settle anything")
        return self.prediction.motion.samples(self.limits, sample_time)

    def lines(self) -> Iterator[str]:
        """What it says, line by line."""
        if not self.open:
            yield "nothing is open: no further recording is needed"
        elif self.rivals:
            yield f"open beside the model found: {', '.join(self.rivals)}"
        elif self.undecided:
            yield "the model found does not explain all, and no rival model is known"
        else:
            yield "the model found explains these recordings, but they do not exclude all other effects"
        if self.prediction is not None and self.useful:
            yield f"the next recording: {self.prediction.motion}"
            for s in self.prediction.separations:
                if s.settles:
                    yield f"  distinguishes {s.rival}: expected odds {odds_text(s.odds)}"
            if self.shown:
                yield f"  shows or excludes, which no recording does so far: {', '.join(self.shown)}"
        yield from self.cannot()

    def cannot(self) -> Iterator[str]:
        """What no motion within the limits settles, and what else would, line by line."""
        if not self.open:
            return
        if self.prediction is None:
            yield f"no motion of the library stays within {_limits(self.limits)} with every model that is possible"
        elif not self.useful:
            yield f"no motion within {_limits(self.limits)} settles anything with the sensors of this table"
        else:
            for s in self.prediction.separations:
                if not s.settles:
                    yield f"  does not settle {s.rival}: expected odds {s.odds:.1f} : 1"
        if self.helpful:
            yield "what would, with the same motion:"
        elif any(self.further.values()):
            yield f"nor would any of these with the same motion: {', '.join(self.further)}"
        for name, settled in self.helpful.items():
            yield f"  {name}: {', '.join(f'{s.rival} (expected odds {odds_text(s.odds)})' for s in settled)}"

    @property
    def helpful(self) -> dict[str, tuple[Separation, ...]]:
        """What of `further` settles something, and what it settles; the most first."""
        found = {name: tuple(s for s in made if s.settles) for name, made in self.further.items()}
        order = sorted(found, key=lambda name: -sum(min(s.gain, ENOUGH) for s in found[name]))
        return {name: found[name] for name in order if found[name]}

    def write(self, folder: str | Path, force: bool = False) -> Path:
        """Write next.json, report.html and, where a motion helps, drive.yaml, a reference to play."""
        with new_folder(Path(folder), force=force) as out:
            if self.motion is not None:
                write_drive(out, Path(folder), self.motion, self.sample_time)
            write_json(out / "next.json", self.content(Path(folder)))
            write_page(next_page(self), out, None)
        return Path(folder)

    def content(self, folder: Path | None = None) -> dict[str, Any]:
        """What next.json has. folder : with the reference."""
        shown, motion = self.prediction, self.motion
        separations = () if shown is None else shown.separations
        found = self.answers[0] if self.answers else ()
        others = [*self.answers[1:], *((*found, name) for name in self.shown)]
        settled = [s.settles for s in separations] + [True] * len(self.shown)
        named = [answer[0] if len(answer) == 1 else list(answer) for answer in (found, *others)]
        return {
            "schema": "shake_ros.next/1",
            "open": self.open,
            "separates": [[named[0], other] for other in compress(named[1:], settled)],
            "motion": None
            if motion is None or shown is None
            else {
                **asdict(shown.motion),
                "reference": None if folder is None else str((folder / "drive.yaml").resolve()),
                "peak": Envelope(*np.max(np.abs(motion), axis=0).tolist())._asdict(),
                "sample_time": self.sample_time,
            },
            "odds": 1.0 / sum(1.0 / s.odds for s in separations) if separations else None,
            "cannot": "; ".join(map(str.strip, self.cannot())),
            "rivals": list(self.rivals),
            "limits": self.limits._asdict(),
            "expected": _log_odds(separations),
            "absent": _log_odds(() if shown is None else shown.absent),
            "further": {name: _log_odds(made) for name, made in self.further.items()},
        }

    def __repr__(self) -> str:
        return "\n".join(self.lines())


def _log_odds(separations: Sequence[Separation]) -> dict[str, dict[str, float]]:
    return {s.rival: {"log_odds": s.gain} for s in separations}


def _limits(limits: Envelope) -> str:
    return f"{1e3 * limits.position:.3g} mm, {limits.velocity:.3g} m/s and {limits.acceleration:.3g} m/s²"


def limits_of(found: Discovery, limits: Mapping[str, float] | None = None) -> Envelope:
    """How far a motion may go.

    Parameters
    ----------
    found : result. A motion keeps to WITHIN of the envelope of a declared table; of an unknown one it asks for no more
        than GROWTH times what the recordings have reached.
    limits : values for "position" [m], "velocity" [m/s], "acceleration" [m/s²] in the place of these.

    Raises
    ------
    ShakeError : an unknown quantity, a value that is not positive.
    """
    own = WITHIN * np.array(envelope(found.table))
    if found.model.stroke is None:
        reached = [
            (np.ptp(r.position) / 2.0, np.max(np.abs(r.velocity)), np.max(np.abs(_felt(r)))) for r in found.records
        ]
        own = np.minimum(GROWTH * np.max(reached, axis=0), [np.inf, *own[1:]])
    given = strict_keys(limits or {}, Envelope._fields, "limits", kind="quantity")
    most = np.array([given.get(name, value) for name, value in zip(Envelope._fields, own, strict=True)])
    if not np.all(most > 0.0):
        raise ShakeError("limits: expected numbers above 0")
    return Envelope(*map(float, most))


def _felt(record: Any) -> Array:
    """Acceleration of a record, of its velocity where it has none."""
    if record.acceleration is not None:
        return np.where(record.whole, record.acceleration, 0.0)
    return np.asarray(np.gradient(record.velocity, record.sample_time))


def next_recording(
    found: Discovery,
    *,
    limits: Mapping[str, float] | None = None,
    interlock: str | InterlockParameters | None = None,
    motions: str = "motions",
    sensors: str = "sensors",
    progress: ProgressOption = True,
) -> NextRecording:
    """The motion that settles what a search has left open, within what the table may do.

    It distinguishes the model found from its rivals, and shows what else it may lack.

    Parameters
    ----------
    found : from `close_loop`, of the model full or unknown.
    limits : largest "position" [m], "velocity" [m/s], "acceleration" [m/s²] of the motion; where not given 80 % of a
        declared table's envelope, or twice what the recordings of an unknown table reached.
    interlock : as it acts, or a name of config/interlock, or a file. A motion that would bring any model nearer to one
        of its limits than 80 % is made smaller, or left out.
    motions, sensors : names of config/experiment or files: the library, and the sensors that the table may lack.
    progress : show it, or a function to call with what is being done and the part done.

    Raises
    ------
    ShakeError : another model; wrong limits or files.
    """
    if found.table.layout is not FULL_LAYOUT:
        raise ShakeError(f"next_recording: needs the model full or unknown, not {found.model.kind}")
    with Progress("next_recording", progress) as bar:
        bar("refitting the rivals", 0.0)
        bounds, dt = limits_of(found, limits), found.estimation[0].sample_time
        rivals, declared = found.rivals, found.model.declared
        effects = tuple(step.chosen.candidate.effect for step in found.closed.search.steps)
        if not found.open and not may_lack(found):
            return NextRecording((), None, bounds, dt, undecided=False, answers=(effects,))
        known = {*effects, *(r.candidate.effect for r in rivals if r.candidate)}
        absent = [c for c in effect_candidates(declared, found.table) if c.effect not in known and may_lack(found)]
        final, lock = of_table(found.closed.search.final.fit), None
        if interlock is not None:
            asked = load_interlock(interlock) if isinstance(interlock, str) else interlock
            lock = tightened(asked, WITHIN)
        designer = Designer.of(declared, final, rivals, bounds, found.estimation, absent, lock)
        best = designer.best(library(motions), bar)
        answers = effects, *(rival.effects(effects) for rival in rivals)
        made = NextRecording(tuple(r.name for r in rivals), best, bounds, dt, found.open, answers=answers)
        if best is None or all(s.settles for s in best.separations):
            return made
        bar("the same with further sensors, and with more mass on the table", 0.9)
        wanted = lacking(further_sensors(sensors), found.estimation[0])
        return replace(made, further=remedies(designer, best, wanted))


def may_lack(found: Discovery) -> bool:
    """Whether effects that the model found lacks are a question: nothing is established, or a residual remains.

    Where an effect is established and the residual is at the noise, another one could merely exist as well.
    """
    established = any(verdict.state == ESTABLISHED for verdict in found.closed.verdicts)
    return found.remaining.above_noise or not established


def remedies(
    designer: Designer, best: PredictedExcitation, sensors: Sequence[FurtherSensor]
) -> dict[str, tuple[Separation, ...]]:
    """What a motion would do to the rivals that it does not settle, with each sensor more and with MORE_MASS more."""
    found = designer.with_sensors(best, sensors)
    heavier = designer.heavier(MORE_MASS)
    if loaded := heavier.predicted(best.motion):
        found[f"{100.0 * MORE_MASS:.0f} % more mass on the table"] = heavier.separated(loaded).separations
    left = {s.rival for s in best.separations if not s.settles}
    return {name: tuple(s for s in made if s.rival in left) for name, made in found.items()}


@dataclass(frozen=True)
class Decided:
    """How open questions were settled."""

    found: Discovery  # the last result; its `failures` name an error that ended the series
    played: tuple[NextRecording, ...]  # motions in their order, each with what it was expected to do
    last: NextRecording | None  # what the last design said; None where that design failed


def decide(
    found: Discovery,
    play: Play,
    *,
    most: int = 2,
    minutes: float | None = None,
    progress: ProgressOption = True,
    extended: Callable[[Discovery], None] = lambda _: None,
    **options: Any,
) -> Decided:
    """Make recordings until nothing is open, nothing within the limits would help, or there are enough of them.

    An error in a recording, or in what follows it, ends the series with the result so far, whose `failures` note it.

    Parameters
    ----------
    found : from `close_loop`.
    play : plays a motion and returns its recording; None ends the series with what it has.
    most : recordings at most.
    minutes : time budget of each search that goes on.
    progress : show it, or a function to call with what is being done and the part done.
    extended : called with the result of each search that went on, before the table moves again.
    options : of `next_recording`.
    """
    played = tuple[NextRecording, ...]()
    asked: NextRecording | None = next_recording(found, progress=progress, **options)
    while asked is not None and asked.motion is not None and len(played) < most:
        more = None
        with found.failures.step(f"further recording {len(played) + 1}"):
            recording = play(asked)
            more = None if recording is None else found.extended(recording, minutes=minutes, progress=progress)
        if more is None:
            break
        found, played, asked = more, (*played, asked), None
        with found.failures.step("result of a further recording"):
            extended(found)
        with found.failures.step("next recording"):
            asked = next_recording(found, progress=progress, **options)
    return Decided(found, played, asked)


def next_page(asked: NextRecording) -> Page:
    """The page of a design: the motion, what it is expected to settle, the rivals' predictions side by side."""
    lines = list(asked.lines())
    page = Page("The next recording", sentence(lines[0]))
    page.heading("Motion")
    for line in lines[1:]:
        page.paragraph(sentence(line.strip()))
    shown = asked.prediction
    if shown is not None:
        rows = [
            (s.rival, f"{s.gain:.1f}", "yes" if s.settles else "no")
            for s in (*sorted(shown.separations, key=lambda s: -s.gain), *sorted(shown.absent, key=lambda s: -s.gain))
        ]
        page.table(("rival", "expected gain [nats]", "distinguished"), rows)
        if asked.motion is not None:
            page.link("drive.yaml, the reference to play", "drive.yaml")
        page.chart(prediction_chart(shown))
    return page


def prediction_chart(shown: PredictedExcitation) -> Chart:
    """Reference, and what each rival would leave unexplained once it is refitted to the recording."""
    record, felt = shown.record, shown.record.felt
    time, whole = (np.arange(n) * record.sample_time for n in (len(record.commands), len(shown.samples)))
    most = sorted(shown.separations or shown.absent, key=lambda s: -s.gain)[: len(COLOURS)]
    rests = [ChartSeries(s.rival, s.left, colour) for s, colour in zip(most, COLOURS, strict=False)]
    panels = (
        Panel("position [mm]", whole, (ChartSeries("reference", 1e3 * shown.samples[:, 0], "c5"),), height=130),
        Panel("acceleration [m/s²]", time, (ChartSeries("predicted by the model found", felt, "c0"),), height=150),
        Panel("left by a rival [m/s²]", time[record.start :], tuple(rests)),
    )
    caption = (
        "The motion; of its first half, which the second mirrors, the acceleration, and what each rival, refitted to "
        "it, would leave unexplained if the model found is true"
    )
    return Chart("next_recording", "time [s]", panels, caption)
