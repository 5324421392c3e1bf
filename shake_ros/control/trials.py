"""Laws tried on a table and its neighbours: what the nonlinear loop does, by worst case, and the law that does best.

Every trial follows a reference under the virtual table of the one table that is known. A loop rings where its
acceleration holds more beyond the reference's band than allowed, and more than the feedforward alone makes of the same
neighbour: what a wrong feedforward shakes is no fault of the loop. The loop is closed a little aside of the reference
and settles at rest before that begins; it comes to rest at its end, and a loop that still moves there rings as well.

What a better model is worth: the identified table in closed loop, controlled by one model of it and by another.

The loop may come out worse for the better model: its gains were made for another table. So it also runs on the table's
neighbours, and what rings there is said.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from shake_ros.control.closed_loop import ClosedLoop, Loop, run_batch, simulate
from shake_ros.control.laws.law import Hold, LawParameters
from shake_ros.control.laws.runner import Controller
from shake_ros.control.laws.virtual_table import VirtualTable
from shake_ros.control.linear_loop import LAWS, WITHOUT_ACCELERATION, Common, Margins, near_surface
from shake_ros.control.metrics import ASIDE, AT_LIMIT, SETTLING, come_to_rest, ringing, settle_first, still_moving
from shake_ros.control.observer.linear import LinearObserver
from shake_ros.control.observer.model import ModelObserver
from shake_ros.control.observer.runner import Observer
from shake_ros.control.robust import DAMPINGS, JERKS, Design, RobustSettings, Search
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.quantities import Parameters, ShakeError

Array = NDArray[np.float64]
P = TypeVar("P", bound=Parameters)
WANTED = np.array([0.005, 0.03, 0.15])  # errors of position, velocity and acceleration that count alike [-]
OVER_FEEDFORWARD = 1.3  # times the ringing of the feedforward alone, which a loop may have
FREE = 0.01  # share of the time at the limit up to which a command counts as free
AT_REST = 0.1  # rms of the acceleration at rest over the reference's, from which a loop rings
RINGING = 0.5  # rms of the acceleration's error above 15 Hz over the reference's
SLOWER = 0.6  # of a bandwidth that rang
SLOWEST = 5  # bandwidths of a calm design that are tried
LONGER = (1.0, 1.5, 2.0, 3.0, 5.0)  # times the shortest horizon of the virtual table that are tried …
HARDER = 2.0 / 3.0  # … under this part of its rate, so that it bears other motions as well


@dataclass(frozen=True)
class Trial:
    """A run on one table."""

    errors: Array  # (3,) of position, velocity, acceleration [-]
    # ringing, still: of `metrics`
    ringing: float
    still: float
    at_limit: float  # share of the time with the command at its limit
    largest: float  # distance from mid-stroke over half the stroke
    jump: float  # largest change of the command in a sample [-]


@dataclass(frozen=True)
class TriedLaw:
    """A law with its gains, and its trials on the table (the first) and its neighbours."""

    kind: str
    parameters: LawParameters
    design: Design
    trials: tuple[Trial, ...]
    rings: float  # its ringing over what is allowed, worst of all; above 1 the loop rings
    slowed: float  # factor on the bandwidth that the nonlinear loop asked for, 1 for none

    @property
    def worst(self) -> Array:
        """(3,) largest errors over the neighbours whose command is free [-]."""
        free = [t.errors for t in self.trials if t.at_limit < FREE] or [t.errors for t in self.trials]
        return np.asarray(np.max(free, axis=0))

    @property
    def score(self) -> float:
        """The largest error over what is wanted; infinite for a loop that rings."""
        found = float(np.max(self.worst / WANTED))
        return found if self.rings <= 1.0 and math.isfinite(found) else math.inf

    @property
    def good(self) -> bool:
        """Whether it is sound and its errors on the table itself are as small as wanted."""
        return math.isfinite(self.score) and bool(np.all(self.trials[0].errors <= WANTED))

    def behind(self, others: Sequence[TriedLaw]) -> float:
        """By how much its error exceeds that of the best of the others, on the table where most; in parts of WANTED.

        Below what is wanted all errors are alike. A neighbour on which every law fails judges none.
        """
        if not math.isfinite(self.score):
            return math.inf
        sound = [law for law in others if math.isfinite(law.score)]
        exceeded = []
        for i, own in enumerate(self.trials):
            if i == 0 or own.at_limit < FREE:
                best = np.min([law.trials[i].errors for law in sound], axis=0)
                exceeded.append(np.max((own.errors - np.maximum(best, WANTED)) / WANTED))
        return max(0.0, float(max(exceeded)))


def rounded(parameters: P) -> P:
    """Six digits, as they are written."""
    values = {f.name: getattr(parameters, f.name) for f in dataclasses.fields(parameters)}
    return parameters.replace(**{name: float(f"{v:.6g}") for name, v in values.items() if isinstance(v, float)})


def trial(run: ClosedLoop, limit: float, stroke: float) -> Trial:
    """The figures of a run once it has settled."""
    run = run.after(SETTLING)
    largest = float(np.nanmax(np.abs(run.truth[:, 0]), initial=0.0)) / (0.5 * stroke)
    if not np.isfinite(run.truth).all():
        return Trial(np.full(3, math.inf), math.inf, math.inf, 1.0, largest, math.inf)
    at_limit = float(np.mean(np.abs(run.command) >= AT_LIMIT * limit))
    jump = float(np.max(np.abs(np.diff(run.command))))
    return Trial(run.tracking_error(), ringing(run), still_moving(run), at_limit, largest, jump)


def looked_at(reference: Array, sample_time: float) -> tuple[Array, float]:
    """What a loop that is looked at follows, and the position at which it is closed [m].

    It settles at rest first, a little aside, and comes to rest at the end.
    """
    rows = settle_first(come_to_rest(reference, sample_time), sample_time)
    return rows, float(rows[0, 0]) + ASIDE


def allowed_ringing(
    controller: Controller,
    tables: Sequence[TableParameters],
    reference: Array,
    feedforward: tuple[Array, Array] | None,
    delay: int,
    further: int = 0,
    bound: float = RINGING,
) -> list[float]:
    """Ringing up to which a loop is sound on each table: a bound, or more than the feedforward alone makes there.

    Parameters
    ----------
    controller : whose feedforward it is.
    reference : of `settle_first`.
    delay : samples by which a command acts late; each table's is longer than the last one's by one, from none to
        `further` in turn.
    """
    if feedforward is None:
        return [bound] * len(tables)
    own = {f.name: getattr(controller.parameters, f.name) for f in dataclasses.fields(Hold)}
    law = Controller("none", Hold(**own), controller.sample_time, controller.model)
    loops = [
        Loop(table, None, law, reference, feedforward, seed=i, delay=delay + i % (further + 1))
        for i, table in enumerate(tables)
    ]
    shaken = run_batch(loops, lambda _, run: ringing(run.after(SETTLING)))
    return [max(bound, OVER_FEEDFORWARD * r) for r in shaken]


def horizon(table: TableParameters, reference: Array, s: RobustSettings) -> float:
    """Horizon with which the virtual table follows a reference best within the rate of its command [s].

    Strong friction reverses by a jump of the pressure: with a horizon too short for the rate it overshoots,
    with one too long it is late.
    """

    def missed(seconds: float) -> float:
        table_ahead = VirtualTable(
            table, s.sample_time, s.model_bandwidth, seconds, 1.0, rate=HARDER * s.model_rate, predict=True
        )
        try:
            _, motion = table_ahead.follow(reference)
        except ShakeError:
            return math.inf
        return float(np.std(motion[:, 2] - reference[:, 2]))

    return min((times * s.model_horizon for times in LONGER), key=missed)


class Trials:
    """Laws on the neighbours of a table under its own model; `fields` are those that all laws share."""

    def __init__(self, search: Search, reference: Array, fields: dict[str, object]) -> None:
        self.search, self.fields = search, fields
        self.s, self.table = search.s, search.tables[0]
        self._reference, self._start = looked_at(reference, search.s.sample_time)
        self._bare = Controller("none", Hold(**fields), self.s.sample_time, self.table)  # type: ignore[arg-type]
        self._feedforward = self.feedforward(self._reference)
        late = round(self.s.loop_delay / self.s.sample_time)
        self._allowed = allowed_ringing(
            self._bare, search.tables, self._reference, self._feedforward, late, self.s.further_delay, self.s.ringing
        )

    def feedforward(self, reference: Array) -> tuple[Array, Array]:
        """Commands and motion of the virtual table along a reference."""
        assert self._bare.virtual is not None
        return self._bare.virtual.follow(reference)

    def observer(self, design: LinearObserver) -> Observer:
        """The observer that carries the table, with the gain of a linear one."""
        return Observer("model", self.observer_parameters(design), self.s.sample_time, self.table)

    def observer_parameters(self, design: LinearObserver) -> ModelObserver:
        """Its parameters."""
        own = {f.name: getattr(design, f.name) for f in dataclasses.fields(LinearObserver)}
        model = str(self.fields["model"])
        return rounded(ModelObserver(**own, model=model, loop_delay=self.s.loop_delay, predict=True))

    def run(self, parameters: LawParameters, kind: str, design: Design) -> list[Trial]:
        """A law on the table and its neighbours, each later than the last by up to the further dead time."""
        law = Controller(kind, parameters, self.s.sample_time, self.table)
        seer = self.observer(design.observer)
        late = round(self.s.loop_delay / self.s.sample_time)
        loops = [
            Loop(
                table,
                seer,
                law,
                self._reference,
                self._feedforward,
                seed=i,
                delay=late + (i % (self.s.further_delay + 1)),
                start=self._start,
            )
            for i, table in enumerate(self.search.tables)
        ]
        return run_batch(loops, lambda i, run: trial(run, law.parameters.limit, loops[i].table.body.stroke))

    def rings(self, trials: Sequence[Trial]) -> list[float]:
        """Ringing on each table over what is allowed there; above 1 the loop rings."""
        return [max(t.ringing / self._allowed[i], t.still / AT_REST) for i, t in enumerate(trials)]

    def attempts(self, design: Design, calm: Sequence[Design]) -> Iterator[Design]:
        """The design, then calm ones, each slower and slower, the fastest first.

        The same damping keeps the oil column quiet.
        """
        yield design
        first = 0 if calm else 1
        slower = [(base.bandwidth * SLOWER**k, base) for base in calm or [design] for k in range(first, SLOWEST)]
        for bandwidth, base in sorted(slower, key=lambda one: -one[0]):
            yield self.search.design(bandwidth, base.damping, base.jerk)

    def tried(self, kind: str, design: Design, calm: Sequence[Design] = ()) -> TriedLaw | None:
        """A law on the first attempt on which it does not ring, or on which it rings the least.

        None where the law cannot be made of any.
        """
        common = Common(self.fields, self.search.beta)
        found: TriedLaw | None = None
        for now in self.attempts(design, calm):
            parameters = LAWS[kind](near_surface(kind, now.feedback), common)
            if parameters is None:
                continue
            parameters = rounded(parameters)
            trials = self.run(parameters, kind, now)
            rings = max(self.rings(trials))
            if found is None or rings < found.rings:
                slowed = min(now.bandwidth / design.bandwidth, 1.0)
                found = TriedLaw(kind, parameters, now, tuple(trials), rings, slowed)
            if rings <= 1.0:
                break
        return found


def try_laws(
    trials: Trials, laws: Sequence[str], progress: Callable[[str, float], None] = lambda *_: None
) -> list[TriedLaw]:
    """Each law on the fastest design that is sound for it, else the slowest; best first, then what rings the least.

    A law that cannot be made of its design is left out.
    """
    search, found = trials.search, list[TriedLaw]()
    progress("bandwidths on the linear models", 0.1)
    slowest = search.design(search.slowest, 0.0, JERKS[-1])
    designs = {}
    for damped in {kind not in WITHOUT_ACCELERATION for kind in laws}:
        dampings = [d for d in DAMPINGS if d > 0.0] if damped else [0.0]
        designs[damped] = search.best(dampings) or slowest, search.calm(dampings)
    for k, kind in enumerate(laws):
        progress(f"{kind} on {len(search.tables)} tables", 0.3 + 0.7 * k / len(laws))
        law = trials.tried(kind, *designs[kind not in WITHOUT_ACCELERATION])
        if law:
            found.append(law)
    return sorted(found, key=lambda law: (not law.good, law.behind(found), law.score, law.rings))


Pair = tuple[Observer, Controller]
Loops = Callable[[TableParameters], Pair]


@dataclass(frozen=True)
class TrackingBenefit:
    """Runs on one table under the model before and the model after."""

    reference: str  # what they follow, by name
    before: ClosedLoop
    after: ClosedLoop
    tuned: ClosedLoop | None = None  # the run with observer and gains made for the table, and `margins`
    margins: Margins | None = None
    # of each loop on the table and its neighbours over what is allowed there, the worst; above 1 it rings
    ringing: Mapping[str, float] = field(default_factory=dict)

    @property
    def runs(self) -> dict[str, ClosedLoop]:
        """The runs by name."""
        runs = {"before": self.before, "after": self.after}
        return runs if self.tuned is None else runs | {"tuned": self.tuned}

    def errors(self) -> dict[str, dict[str, float]]:
        """Relative tracking error of position, velocity and acceleration of each run; NaN where it was lost."""
        names = ("position", "velocity", "acceleration")
        return {
            when: dict(zip(names, (float(e) for e in run.tracking_error()), strict=True))
            for when, run in self.runs.items()
        }

    def warnings(self) -> list[str]:
        """What a laboratory would hear, and what cures it."""
        shaken, found = self.ringing.get("after", 0.0), []
        errors = self.errors()
        if shaken > 1.0:
            found.append(
                "with the extended model and the present gains the closed loop rings on the identified table or "
                "a neighbour: "
                + (
                    f"its acceleration beyond 15 Hz, or at rest, is {shaken:.2g} times what is allowed"
                    if shaken < 1e6
                    else "it is lost"
                )
            )
        elif not errors["after"]["acceleration"] <= 1.05 * errors["before"]["acceleration"]:
            found.append("with the present gains the extended model does not track better than the declared one")
        if found and self.tuned is None:
            found[0] += "; close_loop --tune, or tune --table, makes observer and gains for this table"
        if self.ringing.get("tuned", 0.0) > 1.0:
            found.append("the gains made for this table oscillate on a neighbour too: do not use them")
        return found


def worst_ringing(pair: Pair, tables: Sequence[TableParameters], reference: NDArray[np.float64], delay: int) -> float:
    """The largest ringing of a loop on several tables over what is allowed there [-]; infinite where it was lost."""
    observer, controller = pair
    reference, begin = looked_at(reference, controller.sample_time)
    feedforward = controller.virtual.follow(reference) if controller.virtual else None
    loops = [Loop(t, observer, controller, reference, feedforward, delay=delay, start=begin) for t in tables]
    allowed = allowed_ringing(controller, tables, reference, feedforward, delay)

    def rings(i: int, run: ClosedLoop) -> float:
        settled = run.after(SETTLING)
        return max(ringing(settled) / allowed[i], still_moving(settled) / AT_REST)

    return max(run_batch(loops, rings), default=0.0)


def benefit(
    table: TableParameters,
    before: TableParameters,
    after: TableParameters,
    loops: Loops,
    reference: NDArray[np.float64],
    name: str,
    *,
    delay: int,
    tuned: tuple[Pair, Margins] | None = None,
    neighbours: Sequence[TableParameters] = (),
    seconds: float = 4.5,
) -> TrackingBenefit:
    """Run the same loop twice on one table, with one model in observer and controller and with the other.

    Each has settled at rest before the reference begins.

    Parameters
    ----------
    table : the plant.
    before, after : models.
    loops : observer and controller that carry a model.
    reference : (n, 3) position [m], velocity [m/s], acceleration [m/s²].
    name : of the reference.
    delay : samples by which a command reaches the valve late.
    tuned : observer and controller made for the table, with their margins; they run as well.
    neighbours : tables on which the loops are looked at for `seconds` of the reference [s].
    """
    pairs = {"before": loops(before), "after": loops(after)}
    if tuned:
        pairs["tuned"] = tuned[0]
    ahead = settle_first(reference, pairs["after"][1].sample_time)
    runs = {when: simulate(Loop(table, *pair, ahead, delay=delay))[0].after(SETTLING) for when, pair in pairs.items()}
    part = reference[: round(seconds / pairs["after"][1].sample_time)]
    shaken = {when: worst_ringing(pairs[when], [table, *neighbours], part, delay) for when in pairs if when != "before"}
    margins = tuned[1] if tuned else None
    return TrackingBenefit(name, runs["before"], runs["after"], runs.get("tuned"), margins, shaken)
