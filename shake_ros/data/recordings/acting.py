"""When a recorded command acted, by what the interlock of a plant or bridge says of itself on /diagnostics.

The valve's command is recorded as the controller sends it. While the pressure is off or comes up, in a hold, and while
the master gain is below 1, the valve gets another one, or none, and a model that is driven by it learns nonsense. Each
change is told at once, so the reports in the order of their receipt say it for every sample.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.stretches import stretches
from shake_ros.data.recordings.align import Grid
from shake_ros.data.recordings.bag import Message
from shake_ros.data.recordings.cdr import Integers, UndecodableError, walk
from shake_ros.data.recordings.findings import Finding

TOPIC, TYPE = "diagnostics", "diagnostic_msgs/msg/DiagnosticArray"
PASSES, SPAN = "passes", "span"  # values of a status: whether commands act, and the master gain
FULL = 0.9995  # master gain that counts as 1, as it is printed
BRIEF = 0.05  # [s] a shorter stretch is a matter of which message was received first


def said(data: bytes) -> bool | None:
    """Whether commands act in full, by a message; None where none of its nodes has an interlock."""
    try:
        texts = walk(data, TYPE).texts
    except UndecodableError:
        return None
    nodes: dict[str, dict[str, str]] = {}
    for path, key in texts.items():
        if path.endswith("].key"):
            status = path.partition("].values")[0]
            nodes.setdefault(status, {})[key] = texts[path.removesuffix("key") + "value"]
    told = next((values for values in nodes.values() if PASSES in values), None)
    return None if told is None else told[PASSES] == "True" and _number(told.get(SPAN, "1")) >= FULL


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 1.0


def without_brief(acts: npt.NDArray[np.bool_], most: int) -> npt.NDArray[np.bool_]:
    """The same, without stretches of at most so many samples on which commands did not act.

    >>> without_brief(np.array([False, True, False, False]), 1).tolist()
    [True, True, False, False]
    """
    found = acts.copy()
    for span in stretches(~acts):
        if span.stop - span.start <= most:
            found[span] = True
    return found


class Acting:
    """What the reports of a recording say, in the order of their receipt."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._acts: list[bool] = []

    def add(self, message: Message) -> None:
        """Take one message; only changes are kept."""
        acts = said(message.data)
        if acts is not None and (not self._acts or acts != self._acts[-1]):
            self._received.append(message.received)
            self._acts.append(acts)

    def samples(self, received: Integers) -> npt.NDArray[np.bool_]:
        """Whether commands acted on samples received at these times [ns]; before the first report as it says."""
        if not self._acts:
            return np.ones(len(received), dtype=bool)
        at = np.searchsorted(np.array(self._received), received, side="right") - 1
        return np.array(self._acts)[np.maximum(at, 0)]

    def usable(
        self, received: Integers, grid: Grid, topic: str, findings: list[Finding], partial: bool = False
    ) -> npt.NDArray[np.bool_]:
        """The samples on which commands acted; all of a whole recording that has none. What is left out is reported."""
        acts = without_brief(self.samples(received), round(BRIEF / grid.sample_time))
        idle = int(np.sum(~acts))
        if not idle:
            return acts
        what = "commands did not act in full (pressure off, a hold, or a master gain below 1)"
        if idle == len(acts) and not partial:
            findings.append(Finding("idle", topic, idle, f"{what} on any sample", 0.0))
            return np.ones(len(acts), dtype=bool)
        first = grid.seconds(int(np.argmin(acts)))
        text = f"{what} on {idle} of {len(acts)} samples, which are left out; first at {first:.4g} s"
        findings.append(Finding("idle", topic, idle, text, first))
        return acts
