"""Node `reference_generator`: plays a reference program, by the plant's stamps (lock-step) or by the clock."""

from __future__ import annotations

from dataclasses import dataclass

from shake_ros.core.quantities import Parameters, choice, quantity
from shake_ros.core.reference.program import Program, crossfade, keeps_phase
from shake_ros.data.reference_program import Reference, load_reference, make_program
from shake_ros.ros import interface
from shake_ros.ros.diagnostics import OK
from shake_ros.ros.frame import Frame, node_settings


@dataclass(frozen=True)
class ReferenceNodeParameters(Parameters):
    """The node's own settings; those of the program come from its configuration."""

    reference: str = choice("configuration in config/reference, or a YAML file")
    start_delay: float = quantity("s", "rest before the program starts", low=0.0, high=1e4)


class ReferenceGenerator:
    """Publishes position, velocity and acceleration of each sample; a live change is faded in."""

    def __init__(self, frame: Frame) -> None:
        self.frame = frame
        self.ticks = not frame.lockstep
        settings = ReferenceNodeParameters.from_mapping(
            node_settings("reference_generator"), "config/node/reference_generator.yaml"
        )
        own = frame.parameters.declare(settings).value
        configured = load_reference(own.reference)
        self._reference = configured
        self._delay = round(own.start_delay / frame.sample_time)
        self._k = -self._delay
        self._made: tuple[Parameters, Program] | None = None
        self._shaping = frame.parameters.declare(configured.shaping, "shaping.").value
        self._live = frame.parameters.declare(configured.parameters, accept=self._make)
        self._parameters = self._live.take()
        self._program = self._make(self._parameters)
        self._writer = frame.writer(interface.REFERENCE)
        if frame.lockstep:
            frame.reader(interface.JOINT_STATES, self._on_measured)
        frame.diagnostics.condition = self._condition
        frame.diagnostics.values["sample"] = lambda: self._k

    def _make(self, parameters: Parameters) -> Program:
        """The program of a parameter set; remembered, since it is asked for once to check and once to use."""
        if self._made is None or self._made[0] is not parameters:
            reference = Reference(self._reference.kind, parameters, self._shaping)
            self._made = parameters, make_program(reference, self.frame.sample_time)
        return self._made[1]

    def start(self) -> None:
        """Lock-step waits for the first measurement, real time for the first tick."""

    def finish(self) -> None:
        """Nothing to put away."""

    def tick(self, stamp: int, steps: int) -> None:
        """The sample of this period."""
        self._k += steps
        self._send(stamp)

    def _on_measured(self, stamp: int, _position: float) -> None:
        self._k = self.frame.sample(stamp) - self._delay
        self._send(stamp)

    def _send(self, stamp: int) -> None:
        if self._live.changed:
            self._change()
        self._writer.send(stamp, *self._program.at(self._k))
        self.frame.diagnostics.cycles += 1

    def _change(self) -> None:
        """Fade the accepted change in; what does not keep the phase starts anew, and so does an ended program."""
        old, new = self._parameters, self._live.take()
        restart = self._k >= self._program.length or not keeps_phase(old, new)
        self._parameters = new
        self._program = crossfade(self._program, self._make(new), self._k, self._shaping.change_time, restart)

    def _condition(self) -> tuple[int, str]:
        if self._k < 0:
            return OK, "at rest before the program"
        if self._k >= self._program.length:
            return OK, f"{self._program.kind}: ended"
        return OK, f"{self._program.kind}: running"


def build(frame: Frame) -> ReferenceGenerator:
    """The node in its frame."""
    return ReferenceGenerator(frame)
