"""Stands in for a controller and an operator: commands, services and parameters from a script."""

from __future__ import annotations

import threading
import time
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from shake_ros.ros.conversions import codec
from shake_ros.ros.interface import NAMESPACE, SERVICES, VALVE_COMMAND
from shake_ros.ros.loop import make_executor, ros_context

TIMEOUT = 10.0  # for an answer [s]


class Driver:
    """A node of its own, in a `with` block.

    Parameters
    ----------
    domain_id, namespace : of the graph.
    node : whose services and parameters are called.
    """

    def __init__(self, *, domain_id: int, node: str = "plant", namespace: str = NAMESPACE) -> None:
        self._context = ros_context([], domain_id=domain_id)
        self._target = f"{namespace}/{node}"
        self._namespace = namespace
        self._commands = codec(VALVE_COMMAND)
        self._clients: dict[str, Any] = {}
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Driver:
        self.context = self._context.__enter__()
        self.node = Node("driver", namespace=self._namespace, context=self.context, start_parameter_services=False)
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)
        self.publisher = self.new_publisher()
        return self

    def __exit__(self, *error: Any) -> None:
        self.hold()
        self.executor.remove_node(self.node)
        self.node.destroy_node()
        self.executor.shutdown()
        self._context.__exit__(*error)

    def new_publisher(self) -> Any:
        """A publisher of valve commands in real time."""
        return self.node.create_publisher(VALVE_COMMAND.type, VALVE_COMMAND.name, VALVE_COMMAND.qos(False))

    def send(self, u: float) -> None:
        """One command, stamped now."""
        self.publisher.publish(self._commands.build(time.time_ns(), (u,)))

    def command(self, u: float) -> None:
        """Send a command every 5 ms from now on, until `hold`."""
        self.hold()
        self._stop.clear()
        self._thread = threading.Thread(target=self._repeat, args=(u,), daemon=True)
        self._thread.start()

    def _repeat(self, u: float) -> None:
        while not self._stop.wait(0.005):
            self.send(u)

    def hold(self) -> None:
        """Send nothing more."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        client = self._clients[name]
        assert client.wait_for_service(TIMEOUT), f"no service {name}"
        future = client.call_async(request)
        self.executor.spin_until_future_complete(future, timeout_sec=TIMEOUT)
        assert future.done(), f"{name} does not answer"
        return future.result()

    def service(self, name: str, **request: Any) -> tuple[bool, str]:
        """Call `enable`, `stop` or `reset`: (success, message)."""
        kind = SERVICES[name].type
        answer = self._call(kind, f"{self._namespace}/{name}", kind.Request(**request))
        return answer.success, answer.message

    def set_parameter(self, name: str, value: bool | int | float | str) -> tuple[bool, str]:
        """Set one parameter by the standard service: (success, reason)."""
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        result = self._call(SetParameters, f"{self._target}/set_parameters", request).results[0]
        return result.successful, result.reason
