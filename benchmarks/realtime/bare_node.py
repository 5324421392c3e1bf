"""A bare rclpy node, as a yardstick for start.py: it publishes once it has a reader, then waits for its end."""

from __future__ import annotations

import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def main() -> int:
    rclpy.init()
    node = Node("bare")
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    try:
        while not publisher.get_subscription_count():
            rclpy.spin_once(node, timeout_sec=0.01)
        publisher.publish(DiagnosticArray())
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
