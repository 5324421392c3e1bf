"""How `lab` begins in real time what `--enabled` and `--play` ask for: when all nodes run, and no sooner.

Processes that start load the machine for some seconds, and an interlock that already watched its deadlines would trip
on that. What tripped so before any pressure was asked for is reset, once and with a line; anything else is left to the
operator. The reference plays when commands act, so that the table follows it from its first sample.
"""

from __future__ import annotations

from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from shake_ros.core.safety.causes import TIMED
from shake_ros.ros.interface import ENABLE, RESET
from shake_ros.ros.lab_watch import LabWatch

GENERATOR = "reference_generator"


class LabStart:
    """The first enabling of a graph, and the first `play`; both only as they are asked for.

    Parameters
    ----------
    watch : the lab's eyes. enable, play : what is asked for.
    """

    def __init__(self, watch: LabWatch, enable: bool, play: bool) -> None:
        self._watch = watch
        self._wanted = [*([self._enable, self._wait] if enable else []), *([self._play] if play else [])]
        self._reset_done = False
        self._future: Any = None
        node = watch.node
        self._services: dict[str, Any] = {
            one.name: node.create_client(one.type, one.name) for one in (ENABLE, RESET) if enable
        }
        self._generator = AsyncParameterClient(node, GENERATOR) if play else None

    def go_on(self) -> str:
        """One step of it, without waiting; what there is to say, empty for nothing."""
        return self._wanted[0]() if self._wanted else ""

    def _ask(self, service: Any, name: str) -> Any:
        """Answer of a service; None while there is none."""
        if self._future is None and self._services[name].service_is_ready():
            self._future = self._services[name].call_async(service)
        return self._answer()

    def _answer(self) -> Any:
        if self._future is None or not self._future.done():
            return None
        answer, self._future = self._future.result(), None
        return answer

    def _enable(self) -> str:
        answer = self._ask(ENABLE.type.Request(data=True), ENABLE.name)
        if answer is None:
            return ""
        if answer.success:
            self._wanted.pop(0)
            return ""
        if not self._reset_done and self._watch.tripped <= {*TIMED}:
            self._reset_done = True
            self._wanted.insert(0, self._reset)
            return f"tripped while the nodes started: {answer.message}"
        self._wanted.clear()
        return f"not enabled: {answer.message}"

    def _reset(self) -> str:
        answer = self._ask(RESET.type.Request(), RESET.name)
        if answer is None:
            return ""
        self._wanted.pop(0)
        return "reset, before any pressure" if answer.success else f"reset refused: {answer.message}"

    def _wait(self) -> str:
        if not self._watch.acts:
            return ""
        self._wanted.pop(0)
        return "commands act"

    def _play(self) -> str:
        assert self._generator is not None
        if self._future is None and self._generator.services_are_ready():
            self._future = self._generator.set_parameters([Parameter("play", value=True)])
        answer = self._answer()
        if answer is None:
            return ""
        self._wanted.pop(0)
        result = answer.results[0]
        return "" if result.successful else f"{GENERATOR}: {result.reason or 'play refused'}"
