"""Node `reference_generator`: plays a reference program, by the plant's stamps (lock-step) or by the clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shake_ros.control.reference.program import Program, crossfade, keeps_phase
from shake_ros.quantities import Parameters, choice, quantity
from shake_ros.recordings.reference_file import Reference, load_reference, make_program
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import Behaviour, Frame, Reader
from shake_ros.ros.parameters import LiveLaw, Sets

AT_REST = "rest"
SAME = 1e-7  # [m], [m/s], [m/s²] that need no fading


@dataclass(frozen=True)
class ReferenceNodeParameters(Parameters):
    """The node's own settings; those of the program come from its configuration."""

    reference: str = choice("configuration in config/reference, or a YAML file", live=True)
    play: bool = quantity(
        "", "false: go to rest in the middle; true: play from the beginning, also after the end", live=True
    )
    repeat: bool = quantity("", "play again after the end", live=True)
    start_delay: float = quantity("s", "rest before the program starts", low=0.0, high=1e4)


def load_sets(name: str) -> tuple[str, Sets]:
    """Kind and parameter sets of a configuration by their prefixes."""
    found = load_reference(name)
    return found.kind, {"": found.parameters, "shaping.": found.shaping}


class ReferenceGenerator(Behaviour):
    """Publishes position, velocity and acceleration of each sample; a live change is faded in."""

    def __init__(self, frame: Frame) -> None:
        super().__init__(frame)
        self.ticks = not frame.lockstep
        self._own = frame.settings(ReferenceNodeParameters)
        self._law = LiveLaw(frame.parameters, "reference", self._own, load_sets, self._make, live=True)
        self._delay = round(self._own.value.start_delay / frame.sample_time)
        self._k = -self._delay
        self._begin = 0  # sample at which the program began
        self._taken = self._own.take()
        self._playing = self._taken.play
        (self._reference, made), _ = self._law.take()
        self._program = made if self._playing else self._rest()
        self._writer = frame.writer(interface.REFERENCE)
        if frame.lockstep:
            Reader(frame, interface.JOINT_STATES, self._on_measured)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["sample"] = lambda: self._k

    def _make(self, kind: str, sets: Sets) -> tuple[Reference, Program]:
        reference = Reference(kind, sets[""], sets["shaping."])
        return reference, make_program(reference, self.frame.sample_time)

    def _rest(self) -> Program:
        return Program.from_states(AT_REST, np.zeros((1, 3)), self.frame.sample_time, {})

    def tick(self, stamp: int, steps: int) -> None:
        """The sample of this period."""
        self._k += steps
        self._send(stamp)

    def _on_measured(self, stamp: int, _position: float) -> None:
        self._k = self.frame.sample(stamp) - self._delay
        self._send(stamp)

    def _send(self, stamp: int) -> None:
        if self._law.changed or self._own.changed:
            self._change()
        elif self._ended and self._playing and self._own.value.repeat:
            self._play(self._law.take()[0][1], restart=True)
        self._writer.send(stamp, *self._program.at(self._k - self._begin))
        self.frame.diagnostics.cycles += 1

    @property
    def _ended(self) -> bool:
        return self._k - self._begin >= self._program.length

    def _change(self) -> None:
        """Fade the accepted change in; what does not keep the phase starts anew, and so does an ended program."""
        asked = self._own.changed
        before, self._taken = self._taken, self._own.take()
        play, was_playing = self._taken.play, self._playing
        again = asked and self._taken == before and self._ended  # asked to play again what has ended
        changed = self._law.changed or again
        old, ((self._reference, new), _) = self._reference, self._law.take()
        self._playing = play
        if not play:
            if was_playing:
                self._play(self._rest(), restart=True)
        elif changed or not was_playing:
            in_phase = was_playing and not self._ended and keeps_phase(old.parameters, self._reference.parameters)
            self._play(new, restart=not in_phase)

    def _play(self, new: Program, *, restart: bool) -> None:
        """Go over to another program: at once where it begins at rest where the table is to be, else faded."""
        k, time = self._k - self._begin, self._reference.shaping.change_time
        if not restart:
            self._program = crossfade(self._program, new, k, time)
            return
        left = self._program.samples(k, max(1, self._program.length - k))
        self._begin = max(self._k, 0)
        if np.abs(left[0] - new.at(-1)).max() > SAME or self._k < 0:
            new = crossfade(Program.from_states(new.kind, left, new.sample_time, {}), new, 0, time, restart=True)
        self._program = new

    def _condition(self) -> tuple[int, str]:
        if self._k < 0:
            return OK, "at rest before the program"
        if self._program.kind == AT_REST:
            return OK, "at rest; plays again when the parameter play is true"
        return OK, f"{self._program.kind}: {'ended' if self._ended else 'running'}"


build = ReferenceGenerator
