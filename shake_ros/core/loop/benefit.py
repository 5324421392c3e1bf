"""What a better model is worth: the identified table in closed loop, controlled by one model of it and by another.

The loop may come out worse for the better model: its gains were made for another table. So it also runs on the table's
neighbours, and what rings there is said.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shake_ros.core.control.closed_loop import ClosedLoop
from shake_ros.core.control.runner import Controller
from shake_ros.core.loop.compiled import Loop, run_batch, simulate
from shake_ros.core.loop.linear_loop import Margins
from shake_ros.core.loop.metrics import SETTLING, ringing, settle_first, still_moving
from shake_ros.core.loop.trials import AT_REST, allowed_ringing, looked_at
from shake_ros.core.observer.runner import Observer
from shake_ros.core.plant.parameters import TableParameters

Pair = tuple[Observer, Controller]
Loops = Callable[[TableParameters], Pair]


@dataclass(frozen=True)
class TrackingBenefit:
    """Runs on one table under the model before and the model after.

    Attributes
    ----------
    reference : what they follow, by name. tuned : the run with observer and gains made for the table, and `margins`.
    ringing : of each loop on the table and its neighbours over what is allowed there, the worst; above 1 it rings.
    """

    reference: str
    before: ClosedLoop
    after: ClosedLoop
    tuned: ClosedLoop | None = None
    margins: Margins | None = None
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
                "with the extended model and the present gains the loop rings on the found table or a neighbour: "
                + (
                    f"its acceleration beyond 15 Hz, or at rest, is {shaken:.2g} times what is allowed"
                    if shaken < 1e6
                    else "it is lost"
                )
            )
        elif not errors["after"]["acceleration"] <= 1.05 * errors["before"]["acceleration"]:
            found.append("with the present gains the extended model does not follow better than the declared one")
        if found and self.tuned is None:
            found[0] += "; close_loop --tune, or tune --table, makes observer and gains for this table"
        if self.ringing.get("tuned", 0.0) > 1.0:
            found.append("the gains made for this table ring as well on a neighbour: do not use them")
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
    table : the plant. before, after : models. loops : observer and controller that carry a model.
    reference : (n, 3) position [m], velocity [m/s], acceleration [m/s²]. name : of the reference.
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
